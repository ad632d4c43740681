"""Fixes from the bytes of a satellite receiver: UBX (NAV-PVT, NAV-RELPOSNED) and NMEA.

Messages of one moment belong together, in whatever order a receiver sends them. pyubx2 and
pynmeagps frame and check the bytes; damaged messages are counted and dropped.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, BinaryIO

from pyubx2 import ERR_LOG, NMEA_PROTOCOL, UBX_PROTOCOL, UBXReader

from race_agents.sensing.epoch import Epoch, Told
from race_agents.sensing.place import LocalFrame
from race_agents.unit.readings import Fix
from race_server.core.messages import Source

DAY_S, WEEK_S = 86_400.0, 604_800.0
# GPS time is ahead of the time of day of NMEA by this [s], since 2017.
LEAP_S = 18.0
KNOT = 0.514444  # [m/s]
# Deviations [m] that a quality of NMEA's GGA stands for, where no GST tells them.
DEVIATIONS = {4: 0.02, 5: 0.3, 2: 0.8, 1: 1.5}
# Carrier solution of UBX: 0 none, 1 float, 2 fixed.
FIXED = 2
SPEED_DEVIATION = 0.1  # [m/s] of NMEA's RMC, which tells none
LEAST_DEVIATION = 0.005  # [m] no antenna is known better


@dataclass
class Pulse:
    """The receiver's time in the kart's clock, by its pulse each second (PPS)."""

    offset_s: float | None = None  # kart's clock less time of the week
    day_s: float = 0.0  # time of the week at which the day began (GPS time)

    def mark(self, clock_s: float, week_s: float) -> None:
        """Note a pulse: at this time of the kart's clock it was exactly this second of the week."""
        self.offset_s = clock_s - week_s
        self.day_s = (week_s - LEAP_S) // DAY_S * DAY_S

    def stamp(self, week_s: float) -> float | None:
        """Return a time of the week in the kart's clock [s], None without a pulse."""
        return None if self.offset_s is None else week_s + self.offset_s

    def stamp_of_day(self, day_s: float) -> float | None:
        """Return a time of the day (UTC) in the kart's clock [s], by the day of the last pulse."""
        if self.offset_s is None:
            return None
        return day_s + LEAP_S + self.offset_s + self.day_s


@dataclass
class GnssReader:
    """A receiver's stream of bytes, as fixes."""

    frame: LocalFrame
    pulse: Pulse = field(default_factory=Pulse)
    damaged: int = 0
    _ubx: Epoch = field(default_factory=lambda: Epoch(WEEK_S))
    _nmea: Epoch = field(default_factory=lambda: Epoch(DAY_S))

    def read(self, stream: BinaryIO) -> Iterator[Fix]:
        """Yield fixes until the stream ends."""
        reader = UBXReader(
            stream,
            protfilter=UBX_PROTOCOL | NMEA_PROTOCOL,
            quitonerror=ERR_LOG,
            errorhandler=self._count,
        )
        while True:
            raw, message = reader.read()
            if raw is None:
                yield from self._fixes([*self._ubx.end(), *self._nmea.end()])
                return
            try:
                fixes = [] if message is None else self.take(message)
            except (ValueError, TypeError, AttributeError) as error:  # a field that is empty
                self._count(error)
                continue
            yield from fixes

    def _count(self, error: Exception) -> None:
        del error
        self.damaged += 1

    def take(self, message: Any) -> list[Fix]:
        """Return the fixes that a message completes: as a rule one at most."""
        name = message.identity
        if name == "NAV-PVT":
            told = self._ubx.take(1e-3 * message.iTOW, "PVT", self._of_pvt(message))
        elif name == "NAV-RELPOSNED":
            told = self._ubx.take(1e-3 * message.iTOW, "RELPOSNED", self._heading_of(message))
        elif name == "NAV-EOE":
            told = self._ubx.end()
        elif name.endswith("RMC"):
            told = self._nmea.take(_day_s(message.time), "RMC", self._velocity_of(message))
        elif name.endswith("GST"):
            told = self._nmea.take(_day_s(message.time), "GST", _deviation_of(message))
        elif name.endswith("GGA"):
            told = self._nmea.take(_day_s(message.time), "GGA", self._of_gga(message))
        else:
            told = []
        return self._fixes(told)

    def _fixes(self, moments: list[Told]) -> list[Fix]:
        """Return the fixes of some moments, each with all that was told of it."""
        fixes = []
        for told in moments:
            fix = told.get("PVT") or told.get("GGA")
            if fix is not None:
                parts = (told.get(kind) or {} for kind in ("RELPOSNED", "RMC", "GST"))
                fixes.append(replace(fix, **{k: v for part in parts for k, v in part.items()}))
        return fixes

    def _heading_of(self, message: Any) -> Told | None:
        """Return the heading from one antenna to the other: known where both are fixed."""
        if not (message.relPosValid and message.relPosHeadingValid and message.carrSoln == FIXED):
            return None
        spread = math.radians(float(message.accHeading))
        heading = self.frame.heading(float(message.relPosHeading))
        return {"heading": heading, "heading_deviation": max(spread, 1e-3)}

    def _velocity_of(self, message: Any) -> Told | None:
        """Return speed and course of RMC."""
        if message.status != "A" or message.spd == "":
            return None
        course = self.frame.heading(float(message.cog or 0.0))
        speed = KNOT * float(message.spd)
        return {"speed": speed, "course": course, "speed_deviation": SPEED_DEVIATION}

    def _of_pvt(self, message: Any) -> Fix | None:
        """Return a fix of UBX: millimetres and degrees."""
        if not message.gnssFixOk or message.fixType not in (2, 3, 4):
            return None
        x, y = self.frame.place(message.lat, message.lon, 1e-3 * message.height)
        # hAcc is the error in 68 % of cases in two directions: by √2 for one of them.
        deviation = max(1e-3 * message.hAcc / math.sqrt(2.0), LEAST_DEVIATION)
        corrected = message.diffSoln or message.carrSoln
        return Fix(
            x,
            y,
            deviation,
            Source.CORRECTED_SATELLITES if corrected else Source.SATELLITES,
            stamp_s=self.pulse.stamp(1e-3 * message.iTOW),
            speed=1e-3 * message.gSpeed,
            course=self.frame.heading(float(message.headMot)),
            speed_deviation=max(1e-3 * message.sAcc, 0.02),
        )

    def _of_gga(self, message: Any) -> Fix | None:
        """Return a fix of NMEA, as good as its quality says."""
        quality = int(message.quality or 0)
        if quality not in DEVIATIONS or message.lat == "":
            return None
        height = float(message.alt or 0.0) + float(message.sep or 0.0)
        x, y = self.frame.place(float(message.lat), float(message.lon), height)
        return Fix(
            x,
            y,
            DEVIATIONS[quality],
            Source.SATELLITES if quality == 1 else Source.CORRECTED_SATELLITES,
            stamp_s=self.pulse.stamp_of_day(_day_s(message.time)),
        )


def _deviation_of(message: Any) -> Told | None:
    """Return the deviation of GST, in the worse direction."""
    if message.stdLat == "" or message.stdLong == "":
        return None
    return {"deviation": max(float(message.stdLat), float(message.stdLong), LEAST_DEVIATION)}


def _day_s(time: Any) -> float:
    """Return the time of day [s]."""
    return float(3600.0 * time.hour + 60.0 * time.minute + time.second + 1e-6 * time.microsecond)
