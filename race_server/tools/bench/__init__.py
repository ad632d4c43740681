"""Benchmarks of this program, shown by `race bench`."""
