"""The stages of one tick. Each loads what it needs from the world and stores what it decides."""
