"""Racing as a discipline: its scenarios, its templates, its figures of an episode."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np

from race_server.core import codes
from race_server.core.state import World
from race_server.envs.buffers import Figures
from race_server.envs.racing.decide import decide, give_outcomes, restart, take_actions
from race_server.envs.racing.reset import RaceTemplates
from race_server.envs.racing.reward_terms import REWARDS, TERMS
from race_server.envs.racing.starts import start_tables
from race_server.envs.task import Kernel, Task
from race_server.scenario.checked import check_number
from race_server.scenario.race import Scenario, make_worlds
from race_server.scenario.raceline.attach import with_line
from race_server.scenario.track.reverse import reversed_course

BEFORE = {
    "distance": np.float64,
    "lead": np.float64,
    **dict.fromkeys(("contacts", "wall_contacts", "rank", "items_used", "laps"), np.int64),
}
EPISODE = dict.fromkeys(
    (
        *("laps", "best_lap_us", "last_lap_us", "contacts", "wall_contacts", "crashes"),
        *("status", "rank"),
    ),
    np.int64,
)


@dataclass(frozen=True)
class Racing:
    """Races, and what is special about those that are learned in."""

    random_start: float = 0.0  # share of the rounds with random places instead of the grid
    random_grid: bool = False  # each round begins in another order on the grid
    both_directions: bool = False  # every scenario also with its course reversed
    crash_range: float = 0.0  # [m]; a nearer lidar range is a crash; 0: walls alone decide

    terms: ClassVar[Mapping[str, str]] = TERMS
    rewards: ClassVar[Mapping[str, Mapping[str, float]]] = REWARDS
    figures: ClassVar[Figures] = Figures(BEFORE, EPISODE)
    outcome: ClassVar[str] = "lap_times"

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ScenarioError: one is no share, or no length.
        """
        check_number("random_start", self.random_start, 0.0, 1.0)
        check_number("crash_range", self.crash_range, 0.0)

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

    @property
    def around(self) -> tuple[Kernel, Kernel]:
        """What `decide` does before its ticks and after them."""
        return take_actions, give_outcomes

    @property
    def sensors(self) -> int:
        """Sensors that rewards and ends need on learning karts."""
        return codes.LIDAR if self.crash_range > 0.0 else 0

    def scenarios_of(self, task: Task) -> tuple[Scenario, ...]:
        """Return the scenarios that a reset can draw, with lines if a kart of the task sees one."""
        scenarios = task.scenarios
        if self.both_directions:
            backward = [replace(s, course=reversed_course(s.course), line=None) for s in scenarios]
            scenarios = (*scenarios, *backward)
        return tuple(map(_lined, scenarios)) if task.wants_line else scenarios

    def begin(self, scenarios: Sequence[Scenario], worlds: int) -> tuple[World, RaceTemplates]:
        """Return `worlds` worlds, not yet reset, and a template of each scenario's start."""
        templates = make_worlds(scenarios, [0] * len(scenarios))
        starts, counts = start_tables([scenario.course for scenario in scenarios])
        world = make_worlds([scenarios[0]] * worlds, [0] * worlds)
        boxes = np.zeros((worlds, templates.boxes.shape[1]), templates.boxes.dtype)
        world = world._replace(walls=templates.walls, route=templates.route, boxes=boxes)
        return world, RaceTemplates(
            templates.races,
            templates.rules,
            templates.bodies,
            templates.racers,
            templates.players,
            templates.vehicles,
            templates.boxes,
            starts,
            counts,
        )

    def beside(self, templates: RaceTemplates) -> Sequence[Any]:
        """Return nothing: templates of races never change."""
        return ()

    def report(self, episode: Any) -> dict[str, Any]:
        """Return laps, contacts and place of an episode."""
        return {
            "laps": int(episode["laps"]),
            "best_lap_s": int(episode["best_lap_us"]) / 1e6,
            "crashes": int(episode["crashes"]),
            "contacts": int(episode["contacts"]),
            "wall_contacts": int(episode["wall_contacts"]),
            "rank": int(episode["rank"]),
        }


def _lined(scenario: Scenario) -> Scenario:
    """Return the scenario with a reference line; warn of one that only stands in."""
    lined = with_line(scenario, solve=True)
    if lined.line and lined.line.note:
        warnings.warn(lined.line.note, stacklevel=2)
    return lined
