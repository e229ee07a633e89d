"""Recordings: written, read, replayed and compared."""
