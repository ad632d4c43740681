"""The live server: `live` is its loop, `ear` hears, `desk` answers, `herald` tells everybody."""

from race_server.live.server.loop import LOCKSTEP, REAL, RaceServer
from race_server.live.server.result import RaceResult

__all__ = ["LOCKSTEP", "REAL", "RaceResult", "RaceServer"]
