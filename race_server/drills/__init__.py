"""Drills: trouble made on purpose, and what came of it in figures."""
