"""Compiled mathematics: how scalar code of one point becomes code of many."""
