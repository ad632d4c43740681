"""The reference limit: how fast a vehicle can lap a course, and along which lines."""
