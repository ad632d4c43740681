"""The simulated world: numbers in, numbers out; no file, network, wall clock or person."""
