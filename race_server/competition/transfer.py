"""Drivers here and in a second simulator, and what of it costs them how much.

Between ours and the other one stands a ladder of changes, one at a time: tyres that never slip,
its coarse steps, its actuators; and then its own rate of decisions.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from race_server.competition.lap_exam import CourseTry, LapExamSpec, LapRow, examine
from race_server.core.vehicle_presets import vehicle_named
from race_server.second.highway_motion import ticks_in
from race_server.second.highway_options import NAME
from race_server.second.similarity import Similarity

POLICY_S = 0.2  # of highway-env: from one decision to the next
SLOWER = 0.002  # less time of a lap, as a share, is no loss
HERE, THERE, DECISIONS = "here", "actuators", "decisions"


@dataclass(frozen=True)
class Rung:
    """One change towards the other simulator, and what it changes."""

    name: str
    meaning: str
    simulator: str = ""


# The last but one is the other simulator; decisions are still ours there.
LADDER = (
    Rung(HERE, "our own motion"),
    Rung("tyres", "its motion: wheels that never slip", f"{NAME}:steps=ours,actuators=ours"),
    Rung("steps", "and its steps of 1/15 s", f"{NAME}:actuators=ours"),
    Rung(THERE, "and its actuators: at once, at most 5 m/s² and 45°", NAME),
    Rung(DECISIONS, "and its five decisions a second", NAME),
)


@dataclass(frozen=True)
class TransferRow:
    """One driver on one track, here and there. Its fields are a contract."""

    driver: str
    track: str
    here: Mapping[str, Any]
    there: Mapping[str, Any]
    factor: str  # the change that costs most; empty: none costs anything
    ladder: tuple[Mapping[str, Any], ...]

    @staticmethod
    def of(tries: Mapping[str, CourseTry]) -> "TransferRow":
        """Return the row of one driver on one track. tries: by the name of the rung."""
        first = tries[HERE]
        figures = {name: _figures(one) for name, one in tries.items()}
        ladder = tuple({"change": rung.name, **figures[rung.name]} for rung in LADDER)
        until = [rung.name for rung in LADDER][: [rung.name for rung in LADDER].index(THERE) + 1]
        return TransferRow(
            driver=first.driver,
            track=first.course,
            here=figures[HERE],
            there=figures[THERE],
            factor=_costliest([figures[name] for name in until], until),
            ladder=ladder,
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
        "remark": one.remark,
    }


def _costliest(figures: Sequence[Mapping[str, Any]], names: Sequence[str]) -> str:
    """Return the rung that loses most clean laps against the one before, else most lap time."""
    costs = []
    for before, after, name in zip(figures[:-1], figures[1:], names[1:], strict=True):
        lost = before["clean_lap_rate"] - after["clean_lap_rate"]
        times = before["ratio"], after["ratio"]
        slower = times[1] / times[0] - 1.0 if None not in times else 0.0
        costs.append((max(lost, 0.0), slower if slower > SLOWER else 0.0, name))
    worst = max(costs, key=lambda cost: cost[:2])
    return worst[2] if worst[0] > 0.0 or worst[1] > 0.0 else ""


def drive_ladder(
    spec: LapExamSpec, drivers: Sequence[str], editions: Mapping[str, str]
) -> Iterator[tuple[str, CourseTry]]:
    """Yield the name of the rung, and how a driver did on a course, as they finish.

    editions: as of `examine`.

    Raises:
        RaceError: a course or the vehicle does not exist, or highway-env is not installed.
    """
    similar = Similarity.of([vehicle_named(spec.vehicle)])
    for rung in LADDER:
        this = replace(spec, simulator=rung.simulator)
        if rung.name == DECISIONS:
            this = replace(this, decision_ticks=ticks_in(POLICY_S, similar))
        for one in examine(this, drivers, editions):
            yield rung.name, one


def rows_of(found: Sequence[tuple[str, CourseTry]]) -> list[TransferRow]:
    """Return the row of each driver on each track whose ladder is complete."""
    tries: dict[tuple[str, str], dict[str, CourseTry]] = {}
    for name, one in found:
        tries.setdefault((one.driver, one.course), {})[name] = one
    return [TransferRow.of(rungs) for rungs in tries.values() if len(rungs) == len(LADDER)]
