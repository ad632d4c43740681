"""Self-play: opponents change between stretches of a training, and snapshots are rated."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from random import Random
from typing import Any

from race_agents.policies.session import Policy
from race_agents.training.export import export_policy, metadata_from
from race_agents.training.normaliser import Normaliser
from race_agents.training.rivals import POOL, Rivals, driver_of, short_name
from race_agents.training.settings import LEARNER, Settings
from race_agents.training.tasks import courses_of, evaluation_tasks
from race_server.core.clock import TICK_S
from race_server.core.driver import driver_named
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.sb3 import KartVecEnv
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.kept_file import write_together
from race_server.scenario.race import Scenario
from race_server.storage.results.ratings import Rating, ratings

RATINGS = "ratings.json"
# A rating race ends after this time [s].
LONGEST_S = 120.0
# Time to finish after the winner [s]; karts further behind are ranked where they are.
WAITING_S = 10.0

Order = list[tuple[str, int]]


class SelfPlay:
    """Exchanges opponents, takes snapshots and rates them."""

    def __init__(self, settings: Settings, folder: Path, world: Normaliser, done: int) -> None:
        """Start, or resume after `done` decisions.

        Raises:
            DriverError: a seat or an anchor names no driver.
        """
        for name in sorted({*settings.self_play.seats, *settings.self_play.anchors}):
            if name not in {LEARNER, POOL}:
                driver_named(name)  # a wrong name is refused now, not once it is drawn
        self.settings = settings
        self.rivals = Rivals(settings.self_play, folder)
        self.races, self.ratings = _read(folder / RATINGS)
        self._file = folder / RATINGS
        self._world = world
        played = settings.self_play
        self._stretch, self._resumed_at = -1, done
        self._snapshot = done // played.snapshot

    def go_on(self, learner: Any, done: int) -> bool:
        """Take a snapshot and begin a new stretch when due; return whether ratings changed."""
        played = self.settings.self_play
        is_rated = done // played.snapshot > self._snapshot
        if is_rated:
            self._snapshot = done // played.snapshot
            self.keep(learner, done)
        if done // played.stretch > self._stretch:
            self._stretch = done // played.stretch
            self._exchange(learner)
        return is_rated

    def keep(self, learner: Any, done: int) -> None:
        """Add the present learner to the pool, and rate it."""
        path = self.rivals.place_for(done)
        metadata = metadata_from(self.settings, courses_of(self.settings))
        export_policy(path, learner, self._world, metadata)
        self.rivals.add(path)
        # One that a run reached before it was killed is another network of the same name.
        name = short_name(driver_of(path))
        self.races = [race for race in self.races if name not in {driver for driver, _ in race}]
        self.races += self._raced(path)
        self.ratings = ratings(self.races)
        _write(self._file, self.races, self.ratings)

    @property
    def newest(self) -> Rating | None:
        """The rating of the newest snapshot."""
        names = [short_name(driver_of(path)) for path in self.rivals.snapshots[-1:]]
        return next((one for one in self.ratings if one.driver in names), None)

    def _chance(self, what: str, number: int) -> Random:
        """Return chance for a stretch or a rating: another one in a run that goes on."""
        again = f"-{self._resumed_at}" if self._resumed_at else ""
        return Random(f"{self.settings.seed}-{what}-{number}{again}")

    def _exchange(self, learner: Any) -> None:
        """Begin the next stretch: new opponents, new places on the grid."""
        karts: KartVecEnv = self._world.unwrapped  # type: ignore[assignment]
        chance = self._chance("stretch", self._stretch)
        task = replace(
            karts.batch.task,
            # Scenarios of the batch have their reference lines already.
            scenarios=tuple(_reordered(one, chance) for one in karts.batch.scenarios),
            opponents=self.rivals.seated(chance),
        )
        karts.change(task, chance.getrandbits(31))
        # The last observations are of races that have ended.
        learner._last_obs = self._world.reset()
        learner._last_episode_starts[:] = True
        if learner._vec_normalize_env is not None:
            learner._last_original_obs = self._world.get_original_obs()

    def _raced(self, snapshot: Path) -> list[Order]:
        """Return the orders of races of a snapshot against the pool."""
        played, number = self.settings.self_play, self._snapshot
        chance = self._chance("rating", number)
        task = next(iter(evaluation_tasks(self.settings, courses_of(self.settings)).values()))
        scenario = task.scenarios[0]
        rules = replace(
            scenario.rules, laps=played.laps, limit_s=LONGEST_S, finish_limit_s=WAITING_S
        )
        scenario = replace(scenario, rules=rules)
        opponents = self.rivals.against(snapshot, scenario.karts - 1, chance)
        task = replace(
            task,
            scenarios=tuple(_reordered(scenario, chance) for _ in range(played.races)),
            learners=1,
            opponents=opponents,
            most_steps=0,
        )
        return raced(task, Policy(snapshot), short_name(driver_of(snapshot)), played.races, number)


def raced(task: Task, policy: Policy, name: str, races: int, seed: int) -> list[Order]:
    """Return the finishing orders of several races; the policy drives the first kart."""
    batch = Batch(task, worlds=races, seed=seed, after=STAY)
    for _ in range(round(LONGEST_S / (task.decision_ticks * TICK_S))):
        batch.step(policy.decide(batch.observations[:, 0]))
        if batch.world.races["over"].all():
            break
    names = [name, *(short_name(str(driver)) for driver in task.opponents)]
    ranks = batch.world.racers["rank"].tolist()
    batch.close()
    return [list(zip(names, row, strict=True)) for row in ranks]


def _reordered(scenario: Scenario, chance: Random) -> Scenario:
    """Return a scenario with another order on the grid."""
    return replace(scenario, grid_order=tuple(chance.sample(range(scenario.karts), scenario.karts)))


def _read(path: Path) -> tuple[list[Order], list[Rating]]:
    """Return the races of a run so far, and the ratings that follow from them.

    Raises:
        ScenarioError: the file is damaged.
    """
    if not path.is_file():
        return [], []
    try:
        words = json.loads(path.read_text(encoding="utf-8"))
        races = [[(str(driver), int(rank)) for driver, rank in race] for race in words["races"]]
    except (ValueError, TypeError, KeyError) as error:
        raise ScenarioError(
            f"{path}: damaged: {error}; remove it, and rating begins with the next snapshot"
        ) from error
    return races, ratings(races)


def _write(path: Path, races: list[Order], rated: list[Rating]) -> None:
    words = {"ratings": [asdict(one) for one in rated], "races": races}
    write_together({path: (json.dumps(words, indent=1) + "\n").encode()})
