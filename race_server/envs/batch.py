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
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from race_server.core.kernels.jit import bind
from race_server.core.observation import layout_of
from race_server.core.state import Bytes, Float32s, Floats, World, digest, part_of
from race_server.envs.action_shapes import actions_as, finite
from race_server.envs.actions import RESIDUAL, action_kind
from race_server.envs.advice import Adviser
from race_server.envs.assembly import buffers_for, fitted_with, opponents_for, sensors_of
from race_server.envs.buffers import (
    REENTER,
    RESET_WORLD,
    STAY,
    Buffers,
    part_of_buffers,
)
from race_server.envs.opponents import advise
from race_server.envs.reality_gap import FACTORS
from race_server.envs.round_options import RoundOptions, asked_for, odds_of, seeds_of, with_drawn
from race_server.envs.saved_state import in_one_block, told_apart_by
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.checked import check_whole
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
        seed: int | Sequence[int] | None = 0,
        after: int = RESET_WORLD,
        threads: int = 1,
    ) -> None:
        """Build the worlds, and begin a round in each.

        after: what happens once a learning kart's episode is over, see `envs/buffers.py`. World w
        has the seed `seed + w`, or its own of a sequence; with None the first reset of a world
        without a seed draws one, as Gymnasium asks for. threads: cores to spread the worlds over;
        results do not change.

        Raises:
            ScenarioError, DriverError: the task makes no race.
        """
        check_whole("worlds", worlds, 1)
        check_whole("threads", threads, 1)
        check_whole("after", after, STAY, REENTER)
        self.task = task
        scenarios = task.discipline.scenarios_of(task)
        first = scenarios[0]
        self.karts = first.karts
        self.learners = task.count_learners()
        self.terms = tuple(task.discipline.terms)  # their names, in the order of `buffers.terms`
        self.layout = layout_of(task.observation, first.lidar.rays)
        self._simulator = simulator_named(task.simulator, scenarios) if task.simulator else None
        self.opponents = opponents_for(task, first)
        sensors = sensors_of(task, self.karts, self.opponents)
        self.scenarios = tuple(fitted_with(scenario, sensors) for scenario in scenarios)
        world, self._templates = task.discipline.begin(self.scenarios, worlds)
        buffers = buffers_for(task, self.scenarios, self.opponents, worlds=worlds, after=after)
        self.world, self.buffers, self._state = in_one_block(
            world,
            buffers,
            task.discipline.beside(self._templates),
            told_apart_by(task, self.scenarios, self.layout),
        )
        self._adviser: Adviser | None = None
        if action_kind(task.action) == RESIDUAL:
            self._adviser = Adviser(self.layout, self.layout.slices, self.world.vehicles[0, 0])
        self.threads = min(threads, worlds)
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 else None
        self._restarts: list[Callable[[], None]] = []
        self._restarts_alone: dict[int, Callable[[], None]] = {}  # of single worlds
        self._decisions: list[list[Callable[[], None]]] = []
        for part in self._cut(self.threads):
            self._bind(*part)
        self.is_sown: Bytes = np.ones(worlds, np.uint8)  # (W,) 1 where a world has got a seed
        self.reset(seed)
        self.is_sown[:] = seed is not None

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

    def reset(
        self,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
        worlds: Sequence[int] | None = None,
    ) -> Float32s:
        """Begin a new round in every world, or in some, and return the observations, (W, L, size).

        seed: world w gets `seed + w`, or its own of a sequence, and begins again; without one the
        next rounds follow. options: how rounds begin, see `RoundOptions`; with a saved state the
        worlds go on from it, under new seeds with another future.

        Raises:
            ScenarioError: as many seeds as worlds are needed, or an option asks for what the
                task has not.
        """
        wanted = RoundOptions.of(options)
        chosen = range(self.worlds) if worlds is None else worlds
        if not all(0 <= w < self.worlds for w in chosen):
            raise ScenarioError(f"worlds {list(chosen)}: choose of 0 to {self.worlds - 1}")
        seeds = [None] * len(chosen) if seed is None else seeds_of(seed, chosen)
        if wanted.state:
            self.load_state(wanted.state, worlds)
            sown = self._sow(seeds, chosen)
            self.world.races["seed"][sown] = self.buffers.rounds["seed"][sown]
            return self.buffers.observations
        calls = self._restarts if worlds is None else [self._restart_alone(w) for w in worlds]
        with asked_for(wanted, self.scenarios, self.world, self.buffers, self._templates):
            self._sow(with_drawn(seeds, self.is_sown[list(chosen)]), chosen)
            for begin in calls:
                begin()
        return self.buffers.observations

    def _sow(self, seeds: Sequence[int | None], worlds: Sequence[int]) -> list[int]:
        """Set the seeds of some worlds, and return of which; None leaves one as it is."""
        given = {w: one for w, one in zip(worlds, seeds, strict=True) if one is not None}
        for w, one in given.items():
            self.seed_next(w, one)
        return list(given)

    def _restart_alone(self, w: int) -> Callable[[], None]:
        """Return a call that begins a new round in one world."""
        if w not in self._restarts_alone:
            world, buffers = part_of(self.world, w, w + 1), part_of_buffers(self.buffers, w, w + 1)
            restart = bind(self.task.discipline.restart, world, buffers, self._templates)
            self._restarts_alone[w] = restart
        return self._restarts_alone[w]

    def seed_next(self, w: int, seed: int) -> None:
        """Let the next round of a world be the first one of another seed.

        So a batch goes through any list of seeds, each as if it were driven alone.
        """
        self.is_sown[w] = True
        self.buffers.rounds["seed"][w] = seeds_of([seed], [w])[0]
        for name in ("number", "entries"):
            self.buffers.rounds[name][w] = 0
        self.buffers.episodes["number"][w] = 0

    def step(self, actions: Any = None) -> None:
        """Move every world on by one decision under the learners' actions, shape (W, L, A).

        Without actions those in `buffers.actions` count, so that a caller may write them in place.

        Raises:
            ScenarioError: actions have another shape, or are no numbers.
        """
        if actions is None:
            finite(self.buffers.actions)
        else:
            self.buffers.actions[...] = actions_as(actions, self.buffers.actions.shape)
        if self._adviser is not None:
            advise(self.buffers, self._adviser)
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
        self.buffers.odds[:] = odds_of(weights, len(self.buffers.odds))

    # State

    def save_state(self, worlds: Sequence[int] | None = None, own: bytes = b"") -> bytes:
        """Return the state of some worlds, or of all, as bytes. own: what an interface adds.

        Raises:
            ScenarioError: part of it is in a driver or a simulator that is no kernel.
        """
        self._check_savable()
        return self._state.save(worlds, own)

    def load_state(self, state: bytes, worlds: Sequence[int] | None = None) -> bytes:
        """Put some worlds, or all, into a saved state; return what an interface added to it.

        One saved world fits any number of worlds, otherwise there are as many as were saved.

        Raises:
            ScenarioError: it is of another task or version, or of another number of worlds.
        """
        self._check_savable()
        own = self._state.load(state, worlds)
        self.is_sown[slice(None) if worlds is None else list(worlds)] = True
        self.buffers.rounds["world"] = np.arange(self.worlds)
        self.world.event_counts[:] = 0
        return own

    def _check_savable(self) -> None:
        if self._simulator is not None:
            raise ScenarioError(f"simulator {self.task.simulator} cannot be saved: use our own")
        for group in self.opponents:
            if not group.keeps_all_in_memory:
                raise ScenarioError(
                    f"driver {group.name} keeps its own memory, so that its race cannot be saved: "
                    "choose another opponent"
                )

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how `pickle` makes it again: from its task and its state."""
        return _revived, (self.task, *self._made_of())

    def __deepcopy__(self, memo: dict[int, Any]) -> "Batch":
        """Return a batch that goes on alone; the task never changes and is shared."""
        return _revived(self.task, *self._made_of())

    def _made_of(self) -> tuple[int, int, int, Bytes, Floats, bytes]:
        after, odds = int(self.buffers.settings["after"][0]), self.buffers.odds.copy()
        return self.worlds, after, self.threads, self.is_sown.copy(), odds, self.save_state()

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()


def _revived(
    task: Task, worlds: int, after: int, threads: int, is_sown: Bytes, odds: Floats, state: bytes
) -> Batch:
    batch = Batch(task, worlds=worlds, after=after, threads=threads)
    batch.buffers.odds[:] = odds
    batch.load_state(state)
    batch.is_sown[:] = is_sown  # a copy of one without a seed draws its own
    return batch


def _call_all(calls: Sequence[Callable[[], None]]) -> None:
    for call in calls:
        call()


# Called with the number of decisions so far and with the figures of the episodes that have just
# ended, see `Batch.episode_of`; returns the weights of the scenarios, or None.
Curriculum = Callable[[int, Sequence[dict[str, Any]]], Sequence[float] | None]
