"""Racing: laps, places, contacts and items as a discipline to learn."""

from race_server.envs.racing.discipline import Racing

__all__ = ["Racing"]
