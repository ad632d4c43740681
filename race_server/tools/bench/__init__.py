"""Measurements of our own speed, shown by `race bench`."""
