"""A stand-in for a real kart: its own physics, sensors and actuators, in its own process."""
