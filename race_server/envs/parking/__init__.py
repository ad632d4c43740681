"""Parking: vehicles that drive to their slots as a discipline to learn."""

from race_server.envs.parking.discipline import Parking

__all__ = ["Parking"]
