"""Simulated pupils: drivers with known faults, to examine a coach without people."""
