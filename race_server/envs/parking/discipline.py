"""Parking as a discipline: its scenarios, its templates, its figures of an episode."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from race_server.core.clock import TICK_S
from race_server.core.lots import empty_parking
from race_server.core.rules.parking import ALIGNED_WITHIN
from race_server.core.state import World, empty_sightings
from race_server.envs.buffers import Figures
from race_server.envs.parking.decide import decide, give_outcomes, restart, take_actions
from race_server.envs.parking.heuristics.atlas import NO_ATLAS, make_atlas
from race_server.envs.parking.heuristics.field import empty_field
from race_server.envs.parking.heuristics.table import NUMBERS, check_vehicle, heuristic_named
from race_server.envs.parking.reset import LotTemplates
from race_server.envs.parking.reward_terms import ENDINGS, REWARDS, SHAPINGS, TERMS
from race_server.envs.task import Kernel, Task
from race_server.errors import ScenarioError
from race_server.scenario.checked import check_flag, check_number
from race_server.scenario.race import Scenario, make_worlds

BEFORE = dict.fromkeys(("way", "turn", "steering", "touches", "hits"), np.float64)
EPISODE = {
    **dict.fromkeys(("turn", "way", "reversed"), np.float64),
    **dict.fromkeys(("parked", "ending", "moves", "walked_into", "ticks", "between"), np.int64),
}


@dataclass(frozen=True)
class Parking:
    """Vehicles that drive to their slots."""

    late_ends: bool = False  # time that runs out is an end, not a cut
    heuristic: str = "euclid"  # of the way to the slot, see `heuristics/table.py`
    shaping: str = "difference"  # how the reward reads it, see `reward_terms.py:SHAPINGS`
    discount: float = 0.99  # of the learner, for the shaping `potential`
    # All that learn get the mean of their rewards, until the last of them is done.
    team: bool = False

    terms: ClassVar[Mapping[str, str]] = TERMS
    rewards: ClassVar[Mapping[str, Mapping[str, float]]] = REWARDS
    figures: ClassVar[Figures] = Figures(BEFORE, EPISODE)
    outcome: ClassVar[str] = "parking"
    sensors: ClassVar[int] = 0

    def __post_init__(self) -> None:
        """Check the names.

        Raises:
            ScenarioError: there is no such heuristic or shaping, or a number or flag is none.
        """
        heuristic_named(self.heuristic)
        check_number("discount", self.discount, 0.0, 1.0)
        check_flag("late_ends", self.late_ends)
        check_flag("team", self.team)
        if self.shaping not in SHAPINGS:
            known = ", ".join(SHAPINGS)
            raise ScenarioError(f"shaping {self.shaping!r} is unknown; choose one of {known}")

    @property
    def settings(self) -> Mapping[str, float]:
        """What the kernels read."""
        return {
            "late_ends": self.late_ends,
            "team": self.team,
            "heuristic": NUMBERS[self.heuristic],
            "cells": heuristic_named(self.heuristic).cells,
            "shaping": SHAPINGS.index(self.shaping),
            "discount": self.discount,
        }

    @property
    def restart(self) -> Kernel:
        """The kernel that begins a new round in every world."""
        return restart

    @property
    def decide(self) -> Kernel:
        """The kernel that moves every world on by one decision."""
        return decide

    @property
    def around(self) -> tuple[Kernel, Kernel]:
        """What `decide` does before its ticks and after them."""
        return take_actions, give_outcomes

    def scenarios_of(self, task: Task) -> tuple[Scenario, ...]:
        """Return the scenarios that a reset can draw."""
        return task.scenarios

    def begin(self, scenarios: Sequence[Scenario], worlds: int) -> tuple[World, LotTemplates]:
        """Return `worlds` worlds, not yet reset, and a template of each scenario's start.

        Raises:
            ScenarioError: the heuristic does not fit the vehicle, or is for one vehicle and there
                are several.
        """
        heuristic = heuristic_named(self.heuristic)
        for scenario in scenarios:
            check_vehicle(heuristic, scenario.vehicle_of(0))
        templates = make_worlds(scenarios, [0] * len(scenarios))
        world = make_worlds([scenarios[0]] * worlds, [0] * worlds)
        full = templates.parking
        sizes = (full.parkers.shape[1], full.blocks.shape[1], full.walkers.shape[1])
        parking = empty_parking(worlds, *sizes, full.lots)
        sight = world.sight._replace(sightings=empty_sightings(parking))
        world = world._replace(
            walls=templates.walls, route=templates.route, parking=parking, sight=sight
        )
        atlas = NO_ATLAS
        if heuristic.has_atlas:
            vehicle, *others = dict.fromkeys(scenario.vehicle_of(0) for scenario in scenarios)
            if others:
                raise ScenarioError(
                    f"the heuristic {self.heuristic!r} is for one vehicle: {vehicle.name} and "
                    f"{others[0].name} learn here; take one, or another heuristic"
                )
            courses = zip(templates.rules["course"].tolist(), scenarios, strict=True)
            names = {course: scenario.course.name for course, scenario in courses}
            atlas = make_atlas(full.lots, world.walls, vehicle, [names[n] for n in sorted(names)])
        return world, LotTemplates(
            templates.races,
            templates.rules,
            templates.bodies,
            templates.racers,
            templates.players,
            templates.vehicles,
            templates.parking.parkers,
            empty_field(world.walls, worlds, world.bodies.shape[1], heuristic.cells, atlas),
        )

    def beside(self, templates: LotTemplates) -> Sequence[Any]:
        """Return the ways to all places of each lot, which heuristics keep as long as they hold."""
        field = templates.field
        return (field.ways, field.corners, field.made_for) if field.ways.size else ()

    def report(self, episode: Any) -> dict[str, Any]:
        """Return how an episode ended, and how the vehicle drove."""
        is_parked, turn = bool(episode["parked"]), float(episode["turn"])
        return {
            "is_success": is_parked,
            "aligned": is_parked and turn <= ALIGNED_WITHIN,
            "ending": ENDINGS[int(episode["ending"])],
            "off_deg": math.degrees(turn),
            "time_s": int(episode["ticks"]) * TICK_S,
            "path_m": float(episode["way"]),
            "reversed_m": float(episode["reversed"]),
            "direction_changes": int(episode["moves"]),
            "walked_into": int(episode["walked_into"]),
            "between": bool(episode["between"]),
        }
