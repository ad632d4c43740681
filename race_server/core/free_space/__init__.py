"""Where vehicles can stand and drive among walls and boxes, and how far it is from there."""
