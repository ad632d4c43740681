"""Bytes: the keys, the messages, and how they are written and read."""
