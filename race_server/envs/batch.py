"""Many episodes at once for learning: arrays in, arrays out, nothing copied.

`Batch` is the engine under every interface of this package. It knows worlds, karts, decisions,
rewards and rounds; what they mean is up to the task's discipline, see `envs/task.py`.
Learning karts come first: of K karts the first L learn, the others are driven by scripts. One
decision is one compiled call per kind of scripted driver, and one for all the rest: controls,
physics, sensors, rules, rewards, ends, resets and observations.

A discipline hands over that one call whole, `decide`, and not a kernel for each stage in it. numba
takes functions as arguments, or as what a closure holds, but its disk cache then knows them by a
number that each process draws for itself (tried with numba 0.68: three processes, three entries,
no hit), so that every process would compile for a minute. So the stages that disciplines share are
kernels, and each `decide` calls them by name.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from race_server.core.clock import TICK_S
from race_server.core.kernels.jit import bind
from race_server.core.observation import layout_of, offsets_of
from race_server.core.rules.items import items
from race_server.core.state import Bytes, Float32s, Floats, World, digest, part_of
from race_server.envs.actions import RESIDUAL, action_kind
from race_server.envs.buffers import (
    RESET_WORLD,
    Buffers,
    Sizes,
    make_buffers,
    part_of_buffers,
)
from race_server.envs.opponents import Opponents, advise, advised, opponents_of, opposition_of
from race_server.envs.reality_gap import FACTORS
from race_server.envs.rewards import weights_of
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.race import ABSENT, Scenario
from race_server.scenario.sensors import sensors_for
from race_server.second.simulator import simulator_named


class Batch:
    """W worlds of one task.

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
        """Build the worlds, and begin a round in each.

        after: what happens once a learning kart's episode is over, see `envs/buffers.py`. World w
        has the seed `seed + w`. threads: cores to spread the worlds over; results do not change.

        Raises:
            ScenarioError, DriverError: the task makes no race.
        """
        self.task = task
        scenarios = task.discipline.scenarios_of(task)
        first = scenarios[0]
        self.karts = first.karts
        self.learners = task.count_learners()
        self.terms = tuple(task.discipline.terms)  # their names, in the order of `buffers.terms`
        self.layout = layout_of(task.observation, first.lidar.rays)
        self._advises = action_kind(task.action) == RESIDUAL
        self._simulator = simulator_named(task.simulator, scenarios) if task.simulator else None
        self.opponents = self._find_opponents(first)
        self.scenarios = tuple(_fitted(scenario, self._sensors()) for scenario in scenarios)
        self.world, self._templates = task.discipline.begin(self.scenarios, worlds)
        self.buffers = self._make_buffers(worlds, after, first.lidar.rays)
        self.threads = min(threads, worlds)
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 else None
        self._restarts: list[Callable[[], None]] = []
        self._restarts_of: dict[int, Callable[[], None]] = {}  # of single worlds, made when asked
        self._decisions: list[list[Callable[[], None]]] = []
        for part in self._cut(self.threads):
            self._bind(*part)
        self.reset(seed)

    def _find_opponents(self, scenario: Scenario) -> list[Opponents]:
        """Return the scripted drivers: those of karts that do not learn, and those advised."""
        task, lidar = self.task, scenario.lidar
        gear = np.array([lidar.field, lidar.reach, task.decision_ticks * TICK_S])
        names = tuple(item.name for item in items())
        drivers = task.opponents or ("",)
        found = opponents_of(drivers, self.learners, self.karts, lidar.rays, gear, names)
        if self._advises:
            base = (advised(task.base),)
            found += opponents_of(base, 0, self.learners, lidar.rays, gear, names)
        return found

    def _sensors(self) -> tuple[int, ...]:
        """Return the sensors of every kart: those that its driver's observation needs."""
        own = sensors_for(self.layout.slices) | self.task.discipline.sensors
        sensors = [own] * self.learners + [0] * (self.karts - self.learners)
        for group in self.opponents:
            for kart in group.karts:
                sensors[kart] |= sensors_for(group.layout.slices)
        return tuple(sensors)

    def _make_buffers(self, worlds: int, after: int, rays: int) -> Buffers:
        task, discipline = self.task, self.task.discipline
        settings: Mapping[str, float] = {
            "decision_ticks": task.decision_ticks,
            "action": action_kind(task.action),
            "after": after,
            "most_steps": task.most_steps,
            **discipline.settings,
        }
        return make_buffers(
            Sizes(
                worlds=worlds,
                karts=self.karts,
                learners=self.learners,
                scenarios=len(self.scenarios),
                observation=self.layout.size,
                rays=rays,
            ),
            discipline.figures,
            settings,
            offsets_of(self.layout),
            opposition_of(self.opponents, self.karts),
            weights_of(task.reward, discipline.terms, discipline.rewards),
            task.gap.ranges(),
        )

    def _cut(self, parts: int) -> list[tuple[World, Buffers]]:
        """Return the worlds in `parts` parts of nearly equal size, as views."""
        edges = np.linspace(0, self.worlds, parts + 1).astype(int)
        return [
            (part_of(self.world, first, last), part_of_buffers(self.buffers, first, last))
            for first, last in pairwise(edges)
        ]

    def _bind(self, world: World, buffers: Buffers) -> None:
        """Prepare the calls of one part of the worlds: the scripted drivers', then the rest."""
        discipline, templates = self.task.discipline, self._templates
        self._restarts.append(bind(discipline.restart, world, buffers, templates))
        calls = [
            group.driving(world, buffers.views, buffers.memory, buffers.controls)
            for group in self.opponents
        ]
        if self._simulator is None:
            calls.append(bind(discipline.decide, world, buffers, templates))
        else:
            first, last = (bind(kernel, world, buffers, templates) for kernel in discipline.around)
            ticks = partial(self._simulator, world, buffers.controls, self.task.decision_ticks)
            calls += [first, ticks, last]
        self._decisions.append(calls)

    # What others read

    @property
    def worlds(self) -> int:
        """Number of worlds."""
        return len(self.buffers.rounds)

    @property
    def observations(self) -> Float32s:
        """What the learning karts see, shape (W, L, size)."""
        return self.buffers.observations

    @property
    def rewards(self) -> Float32s:
        """What the last decision was worth, shape (W, L)."""
        return self.buffers.rewards

    @property
    def terminated(self) -> Bytes:
        """1 where an episode ended with the last decision, shape (W, L)."""
        return self.buffers.terminated

    @property
    def truncated(self) -> Bytes:
        """1 where an episode was cut off by the last decision, shape (W, L)."""
        return self.buffers.truncated

    @property
    def terminal(self) -> Float32s:
        """The last observation of episodes that ended with the last decision, (W, L, size)."""
        return self.buffers.terminal

    def digest(self, index: int = 0) -> str:
        """Return the digest of one world."""
        return digest(self.world, index)

    def draws(self, w: int, kart: int) -> dict[str, float]:
        """Return the reality gap that a kart drew for its episode, by name."""
        return dict(zip(FACTORS, self.buffers.draws[w, kart].tolist(), strict=True))

    def episode_of(self, w: int, kart: int) -> dict[str, Any]:
        """Return figures of the episode that ended last for a kart.

        `r` and `l` are its return and its length in decisions, as SB3's Monitor names them; the
        others are those of the discipline.
        """
        row = self.buffers.ended[w, kart]
        return {"r": float(row["total"]), "l": int(row["steps"])} | self.task.discipline.report(row)

    # Time

    def reset(self, seed: int | None = None) -> Float32s:
        """Begin a new round in every world and return the observations, (W, L, size).

        With a seed everything begins again, without one the next rounds follow.
        """
        rounds = self.buffers.rounds
        if seed is not None:
            rounds["seed"] = seed + np.arange(self.worlds)
            for name in ("number", "entries"):
                rounds[name] = 0
            self.buffers.episodes["number"] = 0
        for begin in self._restarts:
            begin()
        return self.buffers.observations

    def restart(self, w: int) -> None:
        """Begin a new round in one world; the observations of its learners are those of its start.

        So an interface can decide itself when a round is over.
        """
        if w not in self._restarts_of:
            world, buffers = part_of(self.world, w, w + 1), part_of_buffers(self.buffers, w, w + 1)
            self._restarts_of[w] = bind(
                self.task.discipline.restart, world, buffers, self._templates
            )
        self._restarts_of[w]()

    def seed_next(self, w: int, seed: int) -> None:
        """Let the next round of a world be the first one of another seed.

        So a batch goes through any list of seeds, each as if it were driven alone.
        """
        self.buffers.rounds["seed"][w] = seed
        self.buffers.rounds["number"][w] = 0
        self.buffers.episodes["number"][w] = 0

    def step(self, actions: Any = None) -> None:
        """Move every world on by one decision under the learners' actions, shape (W, L, A).

        Without actions those in `buffers.actions` count, so that a caller may write them in place.
        """
        if actions is not None:
            self.buffers.actions[...] = np.reshape(actions, self.buffers.actions.shape)
        if self._advises:
            advise(self.buffers, float(self.world.vehicles[0, 0].width))
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
        shape = self.buffers.odds.shape
        if odds.shape != shape or not odds.sum() > 0.0 or (odds < 0.0).any():
            raise ScenarioError(
                f"{len(odds)} weights {list(weights)}: give one for each of the "
                f"{len(self.buffers.odds)} scenarios, none below zero and one above"
            )
        self.buffers.odds[:] = np.cumsum(odds / odds.sum())
        self.buffers.odds[-1] = 1.0

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()


def _call_all(calls: Sequence[Callable[[], None]]) -> None:
    for call in calls:
        call()


# Called with the number of decisions so far and with the figures of the episodes that have just
# ended, see `Batch.episode_of`; returns the weights of the scenarios, or None.
Curriculum = Callable[[int, Sequence[dict[str, Any]]], Sequence[float] | None]


def _fitted(scenario: Scenario, sensors: tuple[int, ...]) -> Scenario:
    """Return a scenario whose karts carry these sensors; those that it leaves out stay away."""
    wanted = [scenario.fitted[k % len(scenario.fitted)] for k in range(scenario.karts)]
    fitted = tuple(
        ABSENT if before == ABSENT else now for before, now in zip(wanted, sensors, strict=True)
    )
    return replace(scenario, fitted=fitted)
