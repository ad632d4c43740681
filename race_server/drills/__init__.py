"""Drills: things that must hold, shown on a running race."""
