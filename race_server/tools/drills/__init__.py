"""Drills: what may go wrong in a session, done on purpose, with figures."""
