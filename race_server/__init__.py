"""A race and game server for karts, and the same world as a training environment."""

__version__ = "0.1.0"
