"""Drivers here and in a second simulator, and what of it costs them how much.

Between ours and the other one stands a ladder of changes, one on top of the other: tyres that never
slip, its coarse steps, its actuators; and then its own rate of decisions. Beside it each change
acts alone: from here, with late answers and faulty sensors among them, and undone alone from there.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from race_server.competition.lap_exam import CourseTry, LapExamSpec, LapRow, examine
from race_server.competition.time_trial.gaps import GAPS, NONE, Gap
from race_server.core.vehicle_presets import vehicle_named
from race_server.second.highway_motion import ticks_in
from race_server.second.highway_options import NAME
from race_server.second.similarity import Similarity

POLICY_S = 0.2  # of highway-env: from one decision to the next
SLOWER = 0.002  # less time of a lap, as a share, is no loss
HERE, THERE, DECISIONS = "here", "actuators", "decisions"
OUR_TYRES, OUR_STEPS, RARELY = "actuators alone", "steps back", "decisions alone"
SENSORS = Gap("sensors", noise=GAPS["noise"].noise, dropouts=GAPS["dropouts"].dropouts)


@dataclass(frozen=True)
class Rung:
    """One run: what is changed in it, and how."""

    name: str
    meaning: str
    simulator: str = ""
    gap: Gap = NONE
    decides_rarely: bool = False


# The last but one is the other simulator; decisions are still ours there.
LADDER = (
    Rung(HERE, "our own motion"),
    Rung("tyres", "its motion: wheels that never slip", f"{NAME}:steps=ours,actuators=ours"),
    Rung("steps", "and its steps of 1/15 s", f"{NAME}:actuators=ours"),
    Rung(THERE, "and its actuators: at once, at most 5 m/s² and 45°", NAME),
    Rung(DECISIONS, "and its five decisions a second", NAME, decides_rarely=True),
)
BESIDE = (
    Rung(OUR_TYRES, "our motion with its actuators", f"{NAME}:tyres=ours,steps=ours"),
    Rung(RARELY, "our motion with its five decisions a second", decides_rarely=True),
    Rung("delay", "our motion, answers act a decision late", gap=GAPS["delay"]),
    Rung("sensors", "our motion, lidar noise of 3 cm, 5 % of its rays lost", gap=SENSORS),
    Rung(OUR_STEPS, "its motion in our steps", f"{NAME}:steps=ours"),
)
RUNGS = (*LADDER, *BESIDE)
# The run in which a change is the only one from here, and that in which it alone is undone there.
# Without its tyres its steps are not there either.
ALONE: Mapping[str, str] = MappingProxyType(
    {
        "tyres": "tyres",
        "actuators": OUR_TYRES,
        "decisions": RARELY,
        "delay": "delay",
        "sensors": "sensors",
    }
)
UNDONE: Mapping[str, str] = MappingProxyType(
    {"tyres": OUR_TYRES, "steps": OUR_STEPS, "actuators": "steps"}
)


@dataclass(frozen=True)
class TransferRow:
    """One driver on one track, here and there. Its fields are a contract."""

    driver: str
    track: str
    here: Mapping[str, Any]
    there: Mapping[str, Any]
    factor: str  # the change that costs most alone, from here; empty: none costs anything
    mends: str  # the change that wins most back when it alone is undone there; empty: none
    ladder: tuple[Mapping[str, Any], ...]
    alone: tuple[Mapping[str, Any], ...]
    undone: tuple[Mapping[str, Any], ...]

    @staticmethod
    def of(tries: Mapping[str, CourseTry]) -> "TransferRow":
        """Return the row of one driver on one track. tries: by the name of the run."""
        first = tries[HERE]
        figures = {name: _figures(one) for name, one in tries.items()}
        here, there = figures[HERE], figures[THERE]
        return TransferRow(
            driver=first.driver,
            track=first.course,
            here=here,
            there=there,
            factor=_greatest({name: _cost(here, figures[run]) for name, run in ALONE.items()}),
            mends=_greatest({name: _cost(figures[run], there) for name, run in UNDONE.items()}),
            ladder=tuple({"change": rung.name, **figures[rung.name]} for rung in LADDER),
            alone=tuple({"change": name, **figures[run]} for name, run in ALONE.items()),
            undone=tuple({"change": name, **figures[run]} for name, run in UNDONE.items()),
        )


def _figures(one: CourseTry) -> dict[str, Any]:
    row = LapRow.of([one])
    return {
        "clean_lap_rate": row.clean_lap_rate,
        "clean_lap_interval": row.clean_lap_interval,
        "ratio": row.ratio,
        "laps": len(one.times_s),
        "contacts": row.contacts,
        "rescues": row.rescues,
        "off_centre_m": one.off_centre_m,
        "failed": one.failed,
        "remark": one.remark,
    }


def _cost(before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[float, float]:
    """Return the share of clean laps that is lost, and of lap time that is added.

    A driver that refused to drive has shown no cost: a policy does at a pace that it did not learn.
    """
    if before["failed"] or after["failed"]:
        return 0.0, 0.0
    lost = before["clean_lap_rate"] - after["clean_lap_rate"]
    times = before["ratio"], after["ratio"]
    slower = times[1] / times[0] - 1.0 if None not in times else 0.0
    return max(lost, 0.0), slower if slower > SLOWER else 0.0


def _greatest(costs: Mapping[str, tuple[float, float]]) -> str:
    """Return the change that costs most clean laps, else most lap time; empty: none costs any."""
    name = max(costs, key=lambda name: costs[name])
    return name if max(costs[name]) > 0.0 else ""


def drive_ladder(
    spec: LapExamSpec, drivers: Sequence[str], editions: Mapping[str, str]
) -> Iterator[tuple[str, CourseTry]]:
    """Yield the name of the run, and how a driver did on a course, as they finish.

    editions: as of `examine`.

    Raises:
        RaceError: a course or the vehicle does not exist, or highway-env is not installed.
    """
    similar = Similarity.of([vehicle_named(spec.vehicle)])
    for rung in RUNGS:
        this = replace(spec, simulator=rung.simulator, gaps=(rung.gap,))
        if rung.decides_rarely:
            this = replace(this, decision_ticks=ticks_in(POLICY_S, similar))
        for one in examine(this, drivers, editions):
            yield rung.name, one


def rows_of(found: Sequence[tuple[str, CourseTry]]) -> list[TransferRow]:
    """Return the row of each driver on each track whose runs are complete."""
    tries: dict[tuple[str, str], dict[str, CourseTry]] = {}
    for name, one in found:
        tries.setdefault((one.driver, one.course), {})[name] = one
    return [TransferRow.of(rungs) for rungs in tries.values() if len(rungs) == len(RUNGS)]
