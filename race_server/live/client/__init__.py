"""Everything that connects to a running server: drivers, spectators, stewards, bridges."""
