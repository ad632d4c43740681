"""The rule book: laps, items, effects, penalties, flags and ranking."""
