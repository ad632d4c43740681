"""Recordings: what a race was made of, written as it is driven, read and driven again."""
