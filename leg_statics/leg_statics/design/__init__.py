"""Choosing the geometry: what designs are worth, searches and the synthesis of the six-bar."""
