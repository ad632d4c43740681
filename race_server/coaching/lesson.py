"""What a driver's session taught: his laps against the limit and against his own best."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from race_server.coaching.advice import Tip, tips_for
from race_server.coaching.corners import Corner, corners_of
from race_server.coaching.faults import Fault, faults_of
from race_server.coaching.lap import Lap, reference_lap
from race_server.coaching.losses import LapLoss, lap_loss
from race_server.coaching.pieces import BestPieces, best_pieces
from race_server.core.clock import MICROSECONDS
from race_server.core.vehicles import Vehicle
from race_server.errors import ScenarioError
from race_server.scenario.raceline.attach import reference_line
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.track.course import Course


@dataclass(frozen=True, eq=False)
class Studied:
    """One lap, and what it lost; without losses where `reason` says why it is not compared."""

    number: int
    lap: Lap
    reason: str
    against_limit: LapLoss | None = None
    against_best: LapLoss | None = None  # also of the best lap itself: all zero
    faults: tuple[Fault, ...] = ()  # against the limit, those that cost most first


@dataclass(frozen=True, eq=False)
class Lesson:
    """A driver's session."""

    driver: str
    course: Course
    vehicle: Vehicle
    note: str  # why something else stands in for the limit; empty if it is that
    limit: Lap
    corners: tuple[Corner, ...]
    laps: tuple[Studied, ...]
    tips: tuple[Tip, ...]
    pieces: BestPieces | None  # of the laps that count, whose places are in `compared`

    @property
    def compared(self) -> tuple[Studied, ...]:
        """The laps that count."""
        return tuple(one for one in self.laps if not one.reason)

    @property
    def best(self) -> Studied | None:
        """The fastest lap that counts."""
        return min(self.compared, key=lambda one: one.lap.time_us, default=None)

    def as_json(self) -> dict[str, Any]:
        """Return the document of the lesson. Its keys are a contract."""
        best = self.best
        return {
            "driver": self.driver,
            "track": self.course.name,
            "vehicle": self.vehicle.name,
            "note": self.note,
            "limit_s": _seconds(self.limit.time_us),
            "best_s": _seconds(best.lap.time_us) if best else None,
            "best_pieces_s": _seconds(self.pieces.time_us) if self.pieces else None,
            "pieces": [
                {
                    "lap": self.compared[piece.lap].number,
                    "begin": round(piece.begin, 2),
                    "end": round(piece.end, 2),
                }
                for piece in (self.pieces.pieces if self.pieces else ())
            ],
            "corners": [self._row(row) for row in range(len(self.corners))],
            "laps": [_lap_row(one) for one in self.laps],
            "tips": [
                {
                    "corner": tip.corner.name,
                    "fault": tip.kind.name.lower(),
                    "size": round(tip.size, 2),
                    "unit": tip.unit,
                    "laps": tip.laps,
                    "of": tip.of,
                    "cost_s": _seconds(tip.cost_us),
                    "words": tip.words,
                }
                for tip in self.tips
            ],
        }

    def _row(self, row: int) -> dict[str, Any]:
        corner, best = self.corners[row], self.best
        places = ("begin", "brake", "entry", "apex", "exit", "end")
        behind = [one.against_best.corners[row].total_us for one in self.laps if one.against_best]
        fault = next((one for one in best.faults if one.corner is corner), None) if best else None
        loss = best.against_limit.corners[row] if best and best.against_limit else None
        return {
            "corner": corner.name,
            "side": "left" if corner.side > 0 else "right",
            **{place: round(getattr(corner, place), 2) for place in places},
            "best_against_limit_s": _seconds(loss.total_us) if loss else None,
            "laps_against_best_s": _seconds(round(fmean(behind))) if behind else None,
            "fault": fault.kind.name.lower() if fault else "",
            "size": round(fault.size, 2) if fault else None,
            "unit": fault.unit if fault else "",
        }


def _lap_row(one: Studied) -> dict[str, Any]:
    loss = one.against_limit
    return {
        "lap": one.number,
        "lap_s": _seconds(one.lap.time_us),
        "not_compared": one.reason,
        "line_us": loss.line_us if loss else None,
        "corners_us": [corner.total_us for corner in loss.corners] if loss else None,
        "behind_limit_us": loss.total_us if loss else None,
        "faults": {fault.corner.name: fault.words for fault in one.faults},
    }


def _seconds(time_us: int) -> float:
    return round(time_us / MICROSECONDS, 6)


class Coach:
    """A course and a vehicle with their corners, and what laps there are compared with."""

    def __init__(self, course: Course, vehicle: Vehicle, *, solve: bool = False) -> None:
        """Find the corners. solve: compute the limit if it is not known, see `reference_line`.

        Raises:
            ScenarioError: no lap of the course slows down for a corner.
        """
        line, self.bounds = reference_line(course, vehicle, solve=solve), bounds_of(vehicle)
        self.course, self.vehicle, self.note = course, vehicle, line.note
        self.limit = reference_lap(course, line, self.bounds)
        self.corners = corners_of(self.limit)
        if not self.corners:
            raise ScenarioError(
                f"{course.name} has no corner for {vehicle.name}, which drives all of it at its "
                "top speed; choose a faster vehicle or another course"
            )

    def study(self, number: int, lap: Lap, best: Lap) -> Studied:
        """Return what a lap lost against the limit and against the driver's best one."""
        loss = lap_loss(lap, self.limit, self.corners, self.bounds)
        own = lap_loss(lap, best, self.corners, self.bounds)
        return Studied(number, lap, "", loss, own, tuple(faults_of(lap, self.limit, loss)))

    def lesson(self, driver: str, laps: Sequence[tuple[int, Lap, str]]) -> Lesson:
        """Return what a driver's laps teach.

        laps: number, lap, and why it is not compared, empty where it is.
        """
        counted = [lap for _, lap, reason in laps if not reason]
        best = min(counted, key=lambda lap: lap.time_us, default=None)
        studied = tuple(
            Studied(number, lap, reason)
            if reason or best is None
            else self.study(number, lap, best)
            for number, lap, reason in laps
        )
        tips = tips_for([one.faults for one in studied if not one.reason])
        given = self.course, self.vehicle, self.note, self.limit, self.corners
        pieces = best_pieces(counted, self.corners, self.bounds) if counted else None
        return Lesson(driver, *given, studied, tips, pieces)
