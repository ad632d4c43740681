"""Drivers, their training and the program of a real kart; installed as `race_agents`."""
