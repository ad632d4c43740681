"""A race seen from above, as pixels: a background drawn once, what moves blended over it."""
