"""How far one thing may be off before a driver fails: one factor at a time, in steps.

Motion is ours. A step that a driver does not hold is the last of its factor, for what is worse is
not asked. These are ranges within which a driver can go to another simulator, or to a car.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from race_server.competition.lap_exam import CourseTry, LapExamSpec, LapRow, examine
from race_server.competition.time_trial.gaps import DECISION_S, NONE, Gap
from race_server.envs.reality_gap import RealityGap

HELD = 0.9  # of laps are clean


@dataclass(frozen=True)
class Sweep:
    """One factor. Its steps are in the order in which they are driven, as it should be first."""

    name: str
    unit: str
    steps: tuple[float, ...]
    # Returns the setting of a step; its name is not looked at.
    gap: Callable[[float], Gap]

    def gap_at(self, step: float) -> Gap:
        """Return the setting in which this factor alone is off."""
        return replace(self.gap(step), name=f"{self.name} {step:g}")


def _reality(factor: str, scale: float = 1.0) -> Callable[[float], Gap]:
    def gap(step: float) -> Gap:
        return Gap("", replace(RealityGap(), **{factor: (step / scale, step / scale)}))

    return gap


_DECISION_MS = 1000.0 * DECISION_S
SWEEPS = (
    Sweep("stiffer tyres", "×", (1.0, 1.5, 2.0, 4.0, 8.0), _reality("stiffness")),
    Sweep("softer tyres", "×", (1.0, 0.85, 0.7, 0.6, 0.5), _reality("stiffness")),
    Sweep("less grip", "×", (1.0, 0.9, 0.8, 0.7, 0.6), _reality("grip")),
    Sweep("more mass", "×", (1.0, 1.1, 1.25, 1.5, 2.0), _reality("mass")),
    Sweep("weaker motor", "×", (1.0, 0.9, 0.8, 0.7, 0.6), _reality("speed_coefficient")),
    Sweep("stronger motor", "×", (1.0, 1.1, 1.2, 1.35, 1.5), _reality("speed_coefficient")),
    Sweep(
        "late answers",
        "ms",
        tuple(decisions * _DECISION_MS for decisions in range(5)),
        _reality("action_delay", _DECISION_MS),
    ),
    Sweep("slow actuators", "s", (0.0, 0.05, 0.1, 0.15, 0.2), _reality("actuator_lag")),
    Sweep("play in the steering", "share", (0.0, 0.05, 0.1, 0.2, 0.4), _reality("steering_play")),
    Sweep("lidar noise", "m", (NONE.noise, 0.03, 0.1, 0.2, 0.4), lambda step: Gap("", noise=step)),
    Sweep(
        "lost lidar rays", "share", (0.0, 0.05, 0.2, 0.5, 0.8), lambda step: Gap("", dropouts=step)
    ),
)


@dataclass(frozen=True)
class SweepRow:
    """One driver and one factor, on all courses. Its fields are a contract."""

    driver: str
    factor: str
    unit: str
    held: float | None  # the last step that was held; None: it fails where nothing is off
    broke: float | None  # the step that was not; None: all were held
    steps: tuple[Mapping[str, Any], ...]  # as they were driven


@dataclass
class _Column:
    """What is known of one driver and one factor so far."""

    driver: str
    sweep: Sweep
    rows: list[LapRow]

    @property
    def is_over(self) -> bool:
        return len(self.rows) == len(self.sweep.steps) or self._is_broken

    @property
    def _is_broken(self) -> bool:
        return self.rows[-1].clean_lap_rate < HELD

    def row(self) -> SweepRow:
        driven = self.sweep.steps[: len(self.rows)]
        held = driven[:-1] if self._is_broken else driven
        return SweepRow(
            driver=self.driver,
            factor=self.sweep.name,
            unit=self.sweep.unit,
            held=held[-1] if held else None,
            broke=driven[-1] if self._is_broken else None,
            steps=tuple(
                {"step": step, **_figures(row)} for step, row in zip(driven, self.rows, strict=True)
            ),
        )


def _figures(row: LapRow) -> dict[str, Any]:
    kept = ("laps", "clean_lap_rate", "clean_lap_interval", "ratio", "contacts", "remarks")
    return {name: value for name, value in asdict(row).items() if name in kept}


def sweep_all(
    spec: LapExamSpec,
    drivers: Sequence[str],
    editions: Mapping[str, str],
    watch: Callable[[str], None],
) -> Iterator[SweepRow]:
    """Yield the row of each driver and each factor as it is known.

    editions, watch: as of `examine`.

    Raises:
        RaceError: a course or the vehicle does not exist.
    """
    as_it_is = _driven(spec, NONE, drivers, editions, watch)
    for sweep in SWEEPS:
        columns = [_Column(driver, sweep, [as_it_is[driver]]) for driver in drivers]
        for step in sweep.steps[1:]:
            going = [column for column in columns if not column.is_over]
            rows = _driven(
                spec, sweep.gap_at(step), [column.driver for column in going], editions, watch
            )
            for column in going:
                column.rows.append(rows[column.driver])
        yield from (column.row() for column in columns)


def _driven(
    spec: LapExamSpec,
    gap: Gap,
    drivers: Sequence[str],
    editions: Mapping[str, str],
    watch: Callable[[str], None],
) -> dict[str, LapRow]:
    """Return how each driver did with one setting, on all courses."""
    tries: dict[str, list[CourseTry]] = {driver: [] for driver in drivers}
    if tries:
        for one in examine(replace(spec, gaps=(gap,)), drivers, editions, watch):
            tries[one.driver].append(one)
    return {driver: LapRow.of(found) for driver, found in tries.items()}
