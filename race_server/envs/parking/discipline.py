"""Parking as a discipline: its scenarios, its templates, its figures of an episode."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from race_server.core.clock import TICK_S
from race_server.core.lots import empty_parking
from race_server.core.rules.parking import ALIGNED_WITHIN
from race_server.core.state import World
from race_server.envs.buffers import Figures
from race_server.envs.parking.decide import decide, restart
from race_server.envs.parking.reset import LotTemplates
from race_server.envs.parking.reward_terms import ENDINGS, REWARDS, TERMS
from race_server.envs.task import Kernel, Task
from race_server.scenario.race import Scenario, make_worlds

BEFORE = dict.fromkeys(("distance", "turn", "steering"), np.float64)
EPISODE = {
    **dict.fromkeys(("turn", "way", "reversed"), np.float64),
    **dict.fromkeys(("parked", "ending", "moves", "walked_into", "ticks"), np.int64),
}


@dataclass(frozen=True)
class Parking:
    """Vehicles that drive to their slots."""

    late_ends: bool = False  # time that runs out is an end, not a cut

    terms: ClassVar[Mapping[str, str]] = TERMS
    rewards: ClassVar[Mapping[str, Mapping[str, float]]] = REWARDS
    figures: ClassVar[Figures] = Figures(BEFORE, EPISODE)
    outcome: ClassVar[str] = "parking"
    sensors: ClassVar[int] = 0

    @property
    def settings(self) -> Mapping[str, float]:
        """What the kernels read."""
        return asdict(self)

    @property
    def restart(self) -> Kernel:
        """The kernel that begins a new round in every world."""
        return restart

    @property
    def decide(self) -> Kernel:
        """The kernel that moves every world on by one decision."""
        return decide

    def scenarios_of(self, task: Task) -> tuple[Scenario, ...]:
        """Return the scenarios that a reset can draw."""
        return task.scenarios

    def begin(self, scenarios: Sequence[Scenario], worlds: int) -> tuple[World, LotTemplates]:
        """Return `worlds` worlds, not yet reset, and a template of each scenario's start."""
        templates = make_worlds(scenarios, [0] * len(scenarios))
        world = make_worlds([scenarios[0]] * worlds, [0] * worlds)
        full = templates.parking
        sizes = (full.parkers.shape[1], full.blocks.shape[1], full.walkers.shape[1])
        parking = empty_parking(worlds, *sizes, full.lots)
        world = world._replace(walls=templates.walls, route=templates.route, parking=parking)
        return world, LotTemplates(
            templates.races,
            templates.rules,
            templates.bodies,
            templates.racers,
            templates.players,
            templates.vehicles,
            templates.parking.parkers,
        )

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
        }
