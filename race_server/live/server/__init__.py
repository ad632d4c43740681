"""The live server: `loop` runs it, `inbox` receives, `requests` answers, `publisher` publishes."""

from race_server.live.server.loop import LOCKSTEP, REAL, RaceServer
from race_server.live.server.result import RaceResult
from race_server.live.server.timing import ServerTiming

__all__ = ["LOCKSTEP", "REAL", "RaceResult", "RaceServer", "ServerTiming"]
