"""Whole events, against the clock and against each other."""
