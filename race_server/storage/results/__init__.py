"""Results that last: every race, entry and lap in one SQLite file. Read `schema` first."""
