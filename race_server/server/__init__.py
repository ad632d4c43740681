"""The live server: `live` is its loop, `ear` hears, `desk` answers, `herald` tells everybody."""

from race_server.server.live import LOCKSTEP, REAL, RaceServer
from race_server.server.outcome import RaceResult

__all__ = ["LOCKSTEP", "REAL", "RaceResult", "RaceServer"]
