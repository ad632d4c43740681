"""A race day: a whole event, from qualification to podium."""
