"""Many races at once for learning: arrays in, arrays out, nothing copied.

`Batch` is the engine under every interface of this package. Learning karts come first: of K karts
the first L learn, the others are driven by scripts. One decision is one compiled call per kind of
scripted driver, and one for all the rest: controls, physics, sensors, rules, items, rewards, ends,
resets and observations.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.driver import driver_named
from race_server.core.kernel_driver import ASIDE, FETCH, memory_size
from race_server.core.kernels.jit import bind
from race_server.core.observation import layout_of, wants_line
from race_server.core.rules.items import items
from race_server.core.state import Bytes, Float32s, Floats, World, digest, part_of
from race_server.envs.actions import (
    MEMORY,
    RESIDUAL,
    WIDTHS,
    action_kind,
    advice_of,
    discrete_table,
)
from race_server.envs.buffers import (
    BEFORE,
    EPISODE,
    RESET_WORLD,
    ROUND,
    SETTINGS,
    Buffers,
    Templates,
    part_of_buffers,
)
from race_server.envs.decide import decide, restart
from race_server.envs.opponents import advised, opponents_of
from race_server.envs.reality_gap import DRAWS, RealityGap
from race_server.envs.rewards import TERMS, reward_weights
from race_server.envs.starts import start_tables
from race_server.errors import ScenarioError
from race_server.scenario.race import ABSENT, Scenario, make_worlds
from race_server.scenario.raceline.attach import with_line
from race_server.scenario.sensors import sensors_for
from race_server.scenario.track.reverse import reversed_course


@dataclass(frozen=True)
class Task:
    """What is to be learned: everything about a batch but its size."""

    scenarios: tuple[Scenario, ...]
    opponents: tuple[str, ...] = ()  # drivers of the karts that do not learn, repeated in turn
    learners: int = 0  # 0: all karts without an opponent's name
    observation: str | tuple[str, ...] = "radar"
    action: str = "continuous"
    base: str = ""  # the driver that a residual action advises
    reward: str | Mapping[str, float] = "progress"
    gap: RealityGap = field(default_factory=RealityGap)
    decision_ticks: int = 3
    most_steps: int = 0  # decisions until an episode is cut off; 0: the rules alone end it
    random_start: float = 0.0  # share of the rounds with random places instead of the grid
    random_grid: bool = False  # each round begins in another order on the grid
    both_directions: bool = False  # every scenario also with its course reversed
    crash_range: float = 0.0  # [m]; a nearer lidar range is a crash

    def all_scenarios(self) -> tuple[Scenario, ...]:
        """Return the scenarios that a reset can draw, with their lines if somebody wants them."""
        scenarios = self.scenarios
        if self.both_directions:
            backward = [replace(s, course=reversed_course(s.course), line=None) for s in scenarios]
            scenarios = (*scenarios, *backward)
        drivers = (*self.opponents, self.base) if self.base else self.opponents
        presets = [driver_named(name).preset for name in drivers]
        if not any(wants_line(observation) for observation in (self.observation, *presets)):
            return scenarios
        return tuple(_lined(scenario) for scenario in scenarios)


class Batch:
    """W races of one task.

    All arrays keep their memory: `observations` (W, L, size), `rewards` (W, L), `terms`
    (W, L, T), `terminated` and `truncated` (W, L), `terminal` (W, L, size) are overwritten by
    each step.
    """

    def __init__(
        self,
        task: Task,
        *,
        worlds: int = 1,
        seed: int = 0,
        after: int = RESET_WORLD,
        threads: int = 1,
    ) -> None:
        """Build the worlds; call `reset` before the first step.

        after: what happens once a learning kart's episode is over, see `envs/buffers.py`. World w
        has the seed `seed + w`. threads: cores to spread the worlds over; results do not change.

        Raises:
            ScenarioError, DriverError: the task makes no race.
        """
        self.task = task
        scenarios = task.all_scenarios()
        first = scenarios[0]
        self.karts = first.karts
        self.learners = self.count_learners(task)
        self.layout = layout_of(task.observation, first.lidar.rays)
        gear = np.array([first.lidar.field, first.lidar.reach, task.decision_ticks * TICK_S])
        names = tuple(item.name for item in items())
        self.opponents = opponents_of(
            task.opponents or ("",), self.learners, self.karts, first.lidar.rays, gear, names
        )
        self._advises = action_kind(task.action) == RESIDUAL
        if self._advises:
            base = advised(task.base)
            rays = first.lidar.rays
            self.opponents += opponents_of((base,), 0, self.learners, rays, gear, names)
        fitted = self._fitted()
        scenarios = tuple(replace(s, fitted=_kept_absent(s, fitted)) for s in scenarios)
        self.scenarios = scenarios
        templates = make_worlds(scenarios, [0] * len(scenarios))
        starts, counts = start_tables([scenario.course for scenario in scenarios])
        self._templates = Templates(
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
        world = make_worlds([first] * worlds, [0] * worlds)
        boxes = np.zeros((worlds, templates.boxes.shape[1]), templates.boxes.dtype)
        self.world: World = world._replace(
            walls=templates.walls, route=templates.route, boxes=boxes
        )
        self.rig = self._make_rig(worlds, after, len(scenarios), first.lidar.rays)
        self.threads = min(threads, worlds)
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 else None
        self._restarts: list[Callable[[], None]] = []
        self._decisions: list[list[Callable[[], None]]] = []
        for part in self._cut(self.threads):
            self._bind(*part)
        self.reset(seed)

    @staticmethod
    def count_learners(task: Task) -> int:
        """Return how many karts of each race learn.

        Raises:
            ScenarioError: none, or nobody would drive the others.
        """
        karts = task.scenarios[0].karts
        if task.learners:
            learners = task.learners
        else:
            learners = max(karts - len(task.opponents), 1) if task.opponents else karts
        if not 1 <= learners <= karts or (learners < karts and not task.opponents):
            raise ScenarioError(
                f"{learners} learning karts of {karts}: choose 1 to {karts}, and name opponents "
                "for the others"
            )
        return learners

    def _fitted(self) -> tuple[int, ...]:
        """Return the sensors of every kart: those that its driver's observation needs."""
        own = sensors_for(self.layout.slices)
        sensors = [own] * self.learners + [0] * (self.karts - self.learners)
        for group in self.opponents:
            for kart in group.karts:
                sensors[kart] |= sensors_for(group.layout.slices)
        if self.task.crash_range > 0.0:
            sensors[: self.learners] = [s | codes.LIDAR for s in sensors[: self.learners]]
        return tuple(sensors)

    def _make_rig(self, worlds: int, after: int, scenarios: int, rays: int) -> Buffers:
        task, karts, learners, size = self.task, self.karts, self.learners, self.layout.size
        gap = task.gap.ranges()
        kind = action_kind(task.action)
        settings = np.zeros(1, SETTINGS)
        settings["crash_range"] = task.crash_range
        settings["decision_ticks"] = task.decision_ticks
        settings["action"] = kind
        settings["after"] = after
        settings["most_steps"] = task.most_steps
        settings["random_start"] = task.random_start
        settings["random_grid"] = task.random_grid
        widest = max((group.layout.size for group in self.opponents), default=1)
        most = max((len(group.layout.numbers) for group in self.opponents), default=1)
        parts = np.full((karts, most), -1, np.int64)
        for group in self.opponents:
            for kart in group.karts:
                parts[kart, : len(group.layout.numbers)] = group.layout.numbers
        # A ring needs room for the newest and for the oldest that a draw can ask for.
        rings = [int(row[1]) + 1 if row[1] > 0 else 0 for row in gap[:2]]
        shape = (worlds, learners)
        return Buffers(
            settings=settings.view(np.recarray),
            parts=np.array(self.layout.numbers, np.int64),
            opponent_parts=parts,
            weights=reward_weights(task.reward),
            odds=np.cumsum(np.full(scenarios, 1.0 / scenarios)),
            gap=gap,
            table=discrete_table(),
            actions=np.zeros((*shape, WIDTHS[kind]), np.float32),
            controls=np.zeros((worlds, karts, 4)),
            commanded=np.zeros((*shape, MEMORY)),
            delayed=np.zeros((*shape, rings[0], 4)),
            late=np.zeros((*shape, rings[1], size), np.float32),
            draws=np.zeros((*shape, len(DRAWS))),
            observations=np.zeros((*shape, size), np.float32),
            terminal=np.zeros((*shape, size), np.float32),
            rewards=np.zeros(shape, np.float32),
            terms=np.zeros((*shape, len(TERMS))),
            terminated=np.zeros(shape, np.uint8),
            truncated=np.zeros(shape, np.uint8),
            idle=np.zeros(shape, np.uint8),
            before=np.zeros(shape, BEFORE),
            episodes=np.zeros(shape, EPISODE),
            ended=np.zeros(shape, EPISODE),
            rounds=np.zeros(worlds, ROUND),
            row=np.zeros((worlds, widest), np.float32),
            views=np.zeros((worlds, karts, widest)),
            memory=np.zeros((worlds, karts, memory_size(rays))),
        )

    def _cut(self, parts: int) -> list[tuple[World, Buffers]]:
        """Return the worlds in so many parts of nearly equal size, as views."""
        edges = np.linspace(0, self.worlds, parts + 1).astype(int)
        return [
            (part_of(self.world, first, last), part_of_buffers(self.rig, first, last))
            for first, last in pairwise(edges)
        ]

    def _bind(self, world: World, rig: Buffers) -> None:
        """Get the calls of one part of the worlds ready: the scripted drivers', then the rest."""
        self._restarts.append(bind(restart, world, rig, self._templates))
        calls = [
            group.driving(len(rig.rounds), rig.views, world.vehicles, rig.memory, rig.controls)
            for group in self.opponents
        ]
        self._decisions.append([*calls, bind(decide, world, rig, self._templates)])

    # What others read

    @property
    def worlds(self) -> int:
        """Number of races."""
        return len(self.rig.rounds)

    @property
    def observations(self) -> Float32s:
        """What the learning karts see, shape (W, L, size)."""
        return self.rig.observations

    @property
    def rewards(self) -> Float32s:
        """What the last decision was worth, shape (W, L)."""
        return self.rig.rewards

    @property
    def terminated(self) -> Bytes:
        """1 where an episode ended with the last decision, shape (W, L)."""
        return self.rig.terminated

    @property
    def truncated(self) -> Bytes:
        """1 where an episode was cut off by the last decision, shape (W, L)."""
        return self.rig.truncated

    @property
    def terminal(self) -> Float32s:
        """The last observation of episodes that ended with the last decision, (W, L, size)."""
        return self.rig.terminal

    def digest(self, index: int = 0) -> str:
        """Return the digest of one world."""
        return digest(self.world, index)

    def draws(self, w: int, kart: int) -> dict[str, float]:
        """Return the reality gap that a kart drew for its episode, by name."""
        return dict(zip(DRAWS, self.rig.draws[w, kart].tolist(), strict=True))

    def episode_of(self, w: int, kart: int) -> dict[str, Any]:
        """Return figures of the episode that ended last for a kart.

        `r` and `l` are its return and its length in decisions, as SB3's Monitor names them.
        """
        row = self.rig.ended[w, kart]
        return {
            "r": float(row["total"]),
            "l": int(row["steps"]),
            "laps": int(row["laps"]),
            "best_lap_s": int(row["best_lap_us"]) / 1e6,
            "crashes": int(row["crashes"]),
            "contacts": int(row["contacts"]),
            "wall_contacts": int(row["wall_contacts"]),
            "rank": int(row["rank"]),
        }

    # Time

    def reset(self, seed: int | None = None) -> Float32s:
        """Begin a new round in every world and return the observations.

        With a seed everything begins anew, without one the next rounds follow.
        """
        rounds = self.rig.rounds
        if seed is not None:
            rounds["seed"] = seed + np.arange(self.worlds)
            for name in ("number", "entries"):
                rounds[name] = 0
            self.rig.episodes["number"] = 0
        for begin in self._restarts:
            begin()
        return self.rig.observations

    def step(self, actions: Any = None) -> None:
        """Move every world on by one decision under the learners' actions, shape (W, L, A).

        Without actions those in `rig.actions` count, so that a caller may write them in place.
        """
        if actions is not None:
            self.rig.actions[...] = np.reshape(actions, self.rig.actions.shape)
        if self._advises:
            width = float(self.world.vehicles[0, 0].width)
            places = slice(ASIDE, FETCH + 1)
            advice = advice_of(self.rig.actions, width)
            self.rig.memory[:, : self.learners, places] = advice
        if self._pool is None:
            for calls in self._decisions:
                _call_all(calls)
        else:
            for done in [self._pool.submit(_call_all, calls) for calls in self._decisions]:
                done.result()

    def set_odds(self, weights: Sequence[float]) -> None:
        """Set how often each scenario is drawn at a reset: the hook for a curriculum.

        Raises:
            ScenarioError: not one weight for each scenario, or none above zero.
        """
        odds: Floats = np.asarray(weights, np.float64)
        if odds.shape != self.rig.odds.shape or not odds.sum() > 0.0 or (odds < 0.0).any():
            raise ScenarioError(
                f"{len(odds)} weights {list(weights)}: give one for each of the "
                f"{len(self.rig.odds)} scenarios, none below zero and one above"
            )
        self.rig.odds[:] = np.cumsum(odds / odds.sum())
        self.rig.odds[-1] = 1.0

    def close(self) -> None:
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown()


def _call_all(calls: Sequence[Callable[[], None]]) -> None:
    for call in calls:
        call()


# Called with the number of decisions so far and with what is told of the episodes that have just
# ended, see `Batch.episode_of`; returns the weights of the scenarios, or None.
Curriculum = Callable[[int, Sequence[dict[str, Any]]], Sequence[float] | None]


def _lined(scenario: Scenario) -> Scenario:
    """Return the scenario with a reference line; warn of one that only stands in."""
    lined = with_line(scenario, solve=True)
    if lined.line and lined.line.note:
        warnings.warn(lined.line.note, stacklevel=2)
    return lined


def _kept_absent(scenario: Scenario, fitted: tuple[int, ...]) -> tuple[int, ...]:
    """Return the sensors of the karts; those that the scenario does not want stay away."""
    wanted = [scenario.fitted[k % len(scenario.fitted)] for k in range(scenario.karts)]
    return tuple(
        ABSENT if before == ABSENT else now for before, now in zip(wanted, fitted, strict=True)
    )
