"""Drills and benchmarks: only the command line imports them."""
