"""Courses: read from a file, built, checked, drawn and packed for the kernels."""
