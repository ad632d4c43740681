"""What `reset(options=...)` may ask of the rounds that begin."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from numbers import Integral
from operator import index
from typing import Any

import numpy as np

from race_server.core.seeds import MOST_SEED
from race_server.core.state import Bytes, Floats, World
from race_server.envs.buffers import Buffers
from race_server.envs.reality_gap import FACTORS
from race_server.errors import ScenarioError
from race_server.scenario.checked import check_number
from race_server.scenario.race import Scenario

# PettingZoo's own tests send this.
MEANINGLESS = {"options"}


@dataclass(frozen=True)
class RoundOptions:
    """What is asked of a round that begins; the rest is drawn."""

    course: str = ""  # name of a course or lot of the task
    grid: tuple[int, ...] = ()  # the place of each kart on the grid, from 0
    gap: Mapping[str, float] = field(default_factory=dict)  # factors of the reality gap, for all
    state: bytes = b""  # a saved state, instead of a beginning

    @classmethod
    def of(cls, options: Mapping[str, Any] | None) -> "RoundOptions":
        """Return what Gymnasium and PettingZoo hand over as `options`.

        Raises:
            ScenarioError: there is no such option, or it does not go with another.
        """
        given = known_options(options, [each.name for each in fields(cls)])
        if "grid" in given:
            given["grid"] = _grid_of(given["grid"])
        if not isinstance(given.get("gap", {}), Mapping):
            raise ScenarioError(f"reset option gap = {given['gap']!r}: give factors by name")
        if given.get("state") and len(given) > 1:
            others = ", ".join(sorted(given.keys() - {"state"}))
            raise ScenarioError(f"reset options state and {others}: a state says where all begins")
        return cls(**given)


def known_options(options: Mapping[str, Any] | None, known: Sequence[str]) -> dict[str, Any]:
    """Return what is asked of a reset, without what means nothing.

    Raises:
        ScenarioError: it is no dictionary, or something in it is not known.
    """
    if not isinstance(options, Mapping | None):
        raise ScenarioError(f"reset options {options!r}: give them by name, in a dictionary")
    given = {key: value for key, value in (options or {}).items() if key not in MEANINGLESS}
    for key in given:
        if key not in known:
            raise ScenarioError(
                f"reset option {key!r} is unknown; choose of {', '.join(known) or 'none'}"
            )
    return given


def _grid_of(places: Any) -> tuple[int, ...]:
    try:
        return tuple(index(place) for place in places)
    except (TypeError, ValueError) as error:
        raise ScenarioError(
            f"reset option grid = {places!r}: give a place for each kart"
        ) from error


def seeds_of(seed: int | Sequence[int | None], worlds: Sequence[int]) -> list[int | None]:
    """Return the seed of each of some worlds: of a number `seed + w`, or its own of a sequence.

    Any whole number is one; beyond 63 bits its lowest ones count.

    Raises:
        ScenarioError: a sequence has not as many, or one of them is no whole number.
    """
    is_list = isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str | bytes)
    for one in seed if is_list else [seed]:  # type: ignore[union-attr]
        if not isinstance(one, Integral | None):
            raise ScenarioError(f"seed = {one!r}: give a whole number")
    seeds = list(seed) if is_list else [int(seed) + w for w in worlds]  # type: ignore[arg-type]
    if len(seeds) != len(worlds):
        raise ScenarioError(f"{len(seeds)} seeds for {len(worlds)} worlds: give one for each")
    return [one if one is None or abs(one) <= MOST_SEED else one & MOST_SEED for one in seeds]


def with_drawn(seeds: Sequence[int | None], is_sown: Bytes) -> list[int | None]:
    """Return the seeds of some worlds, with a drawn one for each that has and had none.

    is_sown: which of them had a seed before.
    """
    if all(is_sown):
        return list(seeds)
    chance = np.random.SeedSequence().generate_state(len(seeds)).tolist()
    return [
        drawn if one is None and not was else one
        for one, drawn, was in zip(seeds, chance, is_sown, strict=True)
    ]


@contextmanager
def asked_for(
    options: RoundOptions,
    scenarios: tuple[Scenario, ...],
    world: World,
    buffers: Buffers,
    templates: Any,
) -> Iterator[None]:
    """Let the rounds that begin inside be as the options say.

    Raises:
        ScenarioError: the task has no such course, grid or gap.
    """
    if not (options.course or options.grid or options.gap):
        yield
        return
    changed = (buffers.odds, buffers.gap, buffers.settings, templates.bodies, templates.racers)
    before = [array.copy() for array in changed]
    try:
        if options.course:
            _choose(options.course, scenarios, buffers)
        if options.grid:
            _line_up(options.grid, world, buffers, templates)
        for name, value in options.gap.items():
            _fix(name, value, buffers)
        yield
    finally:
        for array, values in zip(changed, before, strict=True):
            array[...] = values


def _choose(course: str, scenarios: tuple[Scenario, ...], buffers: Buffers) -> None:
    names = [scenario.course.name for scenario in scenarios]
    if course not in names:
        known = ", ".join(dict.fromkeys(names))
        raise ScenarioError(f"course {course!r} is not one of the task: {known}")
    buffers.odds[:] = odds_of([float(name == course) for name in names], len(names))


def odds_of(weights: Sequence[float], scenarios: int) -> Floats:
    """Return how often each scenario is drawn, summed up, from a weight for each.

    Raises:
        ScenarioError: not one weight for each scenario, or none above zero.
    """
    try:
        odds: Floats = np.asarray(weights, np.float64)
    except (TypeError, ValueError):
        odds = np.zeros(0)
    is_sound = odds.shape == (scenarios,) and bool(np.isfinite(odds).all() and odds.min() >= 0.0)
    if not is_sound or not odds.sum() > 0.0:
        raise ScenarioError(
            f"weights {weights!r}: give one for each of the {scenarios} scenarios, none below zero "
            "and one above"
        )
    summed: Floats = np.cumsum(odds / odds.sum())
    summed[-1] = 1.0
    return summed


def _line_up(grid: tuple[int, ...], world: World, buffers: Buffers, templates: Any) -> None:
    karts = templates.bodies.shape[1]
    for scenario in range(len(templates.bodies)):
        course = world.route.courses[templates.rules[scenario].course]
        if course.grid_count == 0:
            raise ScenarioError("reset option grid: a car park has no grid; leave it out")
        places = range(int(course.grid_count))
        if len(grid) != karts or len(set(grid)) != karts or not set(grid) <= set(places):
            raise ScenarioError(
                f"grid {list(grid)}: give {karts} karts one of the places 0 to {places[-1]} each"
            )
        for k, place in enumerate(grid):
            x, y, heading = world.route.grid[course.grid_start + place]
            body = templates.bodies[scenario, k]
            body.x, body.y, body.heading = x, y, heading
            templates.bodies["trailers"]["heading"][scenario, k] = heading
            templates.racers[scenario, k].grid_place = place
    for name in ("random_start", "random_grid"):
        buffers.settings[name] = 0


def _fix(name: str, value: Any, buffers: Buffers) -> None:
    if name not in FACTORS:
        raise ScenarioError(f"gap {name!r} is unknown; choose of {', '.join(FACTORS)}")
    factor, row = FACTORS[name], list(FACTORS).index(name)
    most = factor.most
    if factor.is_whole:
        # Rings have room for what the task's own range asks for.
        most = float(buffers.gap[row, 1])
    limit = ", the most that the task's own gap draws" if factor.is_whole else ""
    check_number(f"gap {name}", value, factor.least, most, limit)
    buffers.gap[row] = round(value) if factor.is_whole else value
