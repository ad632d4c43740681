"""Time trials: drivers against the clock, one kart alone on a course, in the training world."""
