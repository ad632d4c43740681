"""Drills: provoked failures and attacks on a live session, with figures."""
