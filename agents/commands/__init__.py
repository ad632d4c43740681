"""Commands that this package adds to `race`."""
