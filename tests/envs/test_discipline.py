"""A second discipline through the same engine: stay near a point. No laps, no places, no walls."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest

from race_server.core.clock import SUBSTEPS
from race_server.core.kernels.jit import kernel
from race_server.core.stages.controls import take_controls
from race_server.core.stages.motion import move_bodies
from race_server.core.state import Records, World
from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER, RESET_WORLD, STAY, Buffers, Figures
from race_server.envs.decision import (
    all_are_idle,
    clear_outcome,
    close_episode,
    command_learners,
    weigh_terms,
)
from race_server.envs.observations import write_observations, write_terminal
from race_server.envs.reality_gap import RealityGap
from race_server.envs.rounds import begin_episode, forget_kart, next_round, seed_of_round
from race_server.envs.task import Kernel, Task
from race_server.envs.vector import KartVectorEnv
from race_server.errors import ScenarioError
from race_server.scenario.race import Scenario, make_worlds
from support.courses import SMALL_RING


class Starts(NamedTuple):
    """What each scenario's world looks like at its start."""

    races: Records  # (S,)
    bodies: Records  # (S, K)
    vehicles: Records  # (S, K)


@kernel
def restart(world: World, buffers: Buffers, starts: Starts) -> None:
    """Begin a new round in every world."""
    for w in range(world.races.shape[0]):
        begin_round(world, buffers, starts, w)
        write_observations(world, buffers, w)


@kernel
def begin_round(world: World, buffers: Buffers, starts: Starts, w: int) -> None:
    """Put every kart of one world at its start."""
    world.races[w] = starts.races[next_round(buffers, w)]
    world.races[w].seed = seed_of_round(buffers, w)
    for k in range(world.bodies.shape[1]):
        put_back(world, buffers, starts, w, k)


@kernel
def put_back(world: World, buffers: Buffers, starts: Starts, w: int, k: int) -> None:
    """Put one kart at its start."""
    scenario = buffers.rounds[w].scenario
    world.bodies[w, k] = starts.bodies[scenario, k]
    world.vehicles[w, k] = starts.vehicles[scenario, k]
    forget_kart(buffers, w, k)
    if k < buffers.rewards.shape[1]:
        begin_episode(world, buffers, w, k, False)
        buffers.episodes[w, k].furthest = 0.0


@kernel
def distance_of(world: World, buffers: Buffers, w: int, k: int) -> float:
    """Return the distance [m] of a kart from the point."""
    settings, body = buffers.settings[0], world.bodies[w, k]
    return math.hypot(body.x - settings.point_x, body.y - settings.point_y)


@kernel
def decide(world: World, buffers: Buffers, starts: Starts) -> None:
    """Move every world on by one decision."""
    settings = buffers.settings[0]
    for w in range(world.races.shape[0]):
        command_learners(world, buffers, w)
        for k in range(buffers.rewards.shape[1]):
            buffers.before[w, k].distance = distance_of(world, buffers, w, k)
        take_controls(world.bodies[w], buffers.controls[w])
        for _ in range(settings.decision_ticks * SUBSTEPS):
            move_bodies(world.bodies[w], world.vehicles[w])
        for k in range(buffers.rewards.shape[1]):
            if clear_outcome(buffers, w, k) and judge(world, buffers, w, k):
                write_terminal(world, buffers, w, k)
                if settings.after == REENTER:
                    put_back(world, buffers, starts, w, k)
        if settings.after == RESET_WORLD and all_are_idle(buffers, w):
            begin_round(world, buffers, starts, w)
        write_observations(world, buffers, w)


@kernel
def judge(world: World, buffers: Buffers, w: int, k: int) -> bool:
    """Fill terms, reward and end of one learning kart; return whether its episode is over."""
    episode, distance = buffers.episodes[w, k], distance_of(world, buffers, w, k)
    buffers.terms[w, k, 0] = -distance
    buffers.terms[w, k, 1] = buffers.before[w, k].distance - distance
    weigh_terms(buffers, w, k)
    episode.furthest = max(episode.furthest, distance)
    return close_episode(buffers, w, k, distance > buffers.settings[0].limit, False)


@dataclass(frozen=True)
class StayNear:
    """Stay near a point [m]; a kart that is further away than the limit [m] has lost it."""

    point_x: float
    point_y: float
    limit: float = 4.0

    terms: ClassVar[Mapping[str, str]] = {
        "near": "how far the point is [m], below zero",
        "nearer": "distance gained towards the point [m]",
    }
    rewards: ClassVar[Mapping[str, Mapping[str, float]]] = {"near": {"near": 1.0}}
    figures: ClassVar[Figures] = Figures({"distance": np.float64}, {"furthest": np.float64})
    sensors: ClassVar[int] = 0
    outcome: ClassVar[str] = "nearness"

    @property
    def settings(self) -> Mapping[str, float]:
        return {"point_x": self.point_x, "point_y": self.point_y, "limit": self.limit}

    @property
    def restart(self) -> Kernel:
        return restart

    @property
    def decide(self) -> Kernel:
        return decide

    def scenarios_of(self, task: Task) -> tuple[Scenario, ...]:
        return task.scenarios

    def begin(self, scenarios: Sequence[Scenario], worlds: int) -> tuple[World, Starts]:
        made = make_worlds(scenarios, [0] * len(scenarios))
        world = make_worlds([scenarios[0]] * worlds, [0] * worlds)
        return world, Starts(made.races, made.bodies, made.vehicles)

    def beside(self, templates: Starts) -> Sequence[Any]:
        return ()

    def report(self, episode: Any) -> dict[str, Any]:
        return {"furthest": float(episode["furthest"])}


KARTS = 2
SCENARIO = Scenario(SMALL_RING, karts=KARTS)


def near_task(limit: float = 4.0, **options: Any) -> Task:
    """Stay near the place where kart 0 starts."""
    start = make_worlds([SCENARIO], [0]).bodies[0, 0]
    point = StayNear(float(start["x"]), float(start["y"]), limit)
    defaults: dict[str, Any] = {"observation": ("speed", "steering"), "reward": "near"}
    return Task((SCENARIO,), point, **{**defaults, **options})


AHEAD = np.tile(np.array([1.0, 0.0, 0.0], np.float32), (1, KARTS, 1))


def test_its_rewards_are_its_own_terms_weighed() -> None:
    batch = Batch(near_task(reward={"near": 1.0, "nearer": 10.0}))
    assert batch.terms == ("near", "nearer")
    for _ in range(10):
        batch.step(AHEAD)
    near, nearer = batch.buffers.terms[0, 0]
    assert batch.rewards[0, 0] == pytest.approx(near + 10.0 * nearer)
    assert near < 0.0
    assert nearer < 0.0
    assert batch.observations.shape == (1, KARTS, 2)
    assert batch.observations[0, 0, 0] == pytest.approx(batch.world.bodies["speed"][0, 0])


def test_its_own_end_ends_an_episode_and_its_own_figures_tell_of_it() -> None:
    batch, ends = Batch(near_task(limit=1.0), after=STAY), 0
    for _ in range(100):
        batch.step(AHEAD)
        if batch.terminated[0, 0]:
            ends += 1
            last = batch.terminal[0, 0].copy()
    episode = batch.episode_of(0, 0)
    assert ends == 1
    assert list(episode) == ["r", "l", "furthest"]
    assert 1.0 < episode["furthest"] < 1.5
    assert episode["r"] < 0.0
    assert last[0] > 0.0


def test_a_world_begins_again_when_all_its_episodes_are_over() -> None:
    batch = Batch(near_task(limit=100.0, most_steps=5), worlds=3, after=RESET_WORLD)
    cuts = []
    for _ in range(10):
        batch.step(np.tile(AHEAD, (3, 1, 1)))
        cuts.append(int(batch.truncated.sum()))
    assert cuts == [0, 0, 0, 0, 6] * 2
    assert batch.buffers.rounds["number"].tolist() == [3, 3, 3]
    assert (batch.world.bodies["speed"] == 0.0).all()


def test_a_kart_comes_back_alone() -> None:
    batch = Batch(near_task(limit=2.0), after=REENTER)
    still = np.zeros_like(AHEAD)
    still[0, 0, 0] = 1.0  # only kart 0 drives away
    ended = []
    for _ in range(100):
        batch.step(still)
        ended += np.flatnonzero(batch.terminated[0]).tolist()
    assert set(ended) == {0}
    assert len(ended) > 1
    assert batch.buffers.rounds["number"][0] == 1
    assert batch.buffers.episodes["number"][0].tolist() == [1 + len(ended), 1]


def test_seed_and_reality_gap_work_for_it_as_for_a_race() -> None:
    gap = RealityGap(mass=(0.8, 1.2), observation_delay=(1.0, 1.0))
    batch = Batch(near_task(gap=gap), worlds=4, threads=2)
    first = batch.reset(5).copy()
    draws = [batch.draws(w, 0) for w in range(4)]
    assert len({draw["mass"] for draw in draws}) == 4
    batch.step(np.tile(AHEAD, (4, 1, 1)))
    assert np.array_equal(batch.observations, first)  # one decision late
    batch.reset(5)
    assert [batch.draws(w, 0) for w in range(4)] == draws
    batch.close()


def test_a_vector_environment_takes_it_as_it_takes_a_race() -> None:
    vector = KartVectorEnv(near_task(limit=1.0), worlds=2)
    seen, _ = vector.reset(seed=1)
    assert seen.shape == vector.observation_space.shape == (4, 2)
    for _ in range(100):
        seen, rewards, ended, _, infos = vector.step(np.tile(AHEAD[0], (2, 1)))
        if ended.any():
            break
    assert ended.any()
    assert (rewards <= 0.0).all()
    assert infos["final_obs"][np.argmax(ended)].shape == (2,)
    assert infos["nearness"]["furthest"].max() > 1.0
    assert "laps" not in infos["nearness"]
    vector.close()


def test_stable_baselines_learns_in_it_too() -> None:
    pytest.importorskip("stable_baselines3")
    from race_server.envs.sb3 import KartVecEnv

    karts = KartVecEnv(near_task(limit=100.0, most_steps=3), worlds=2, seed=1)
    karts.reset()
    for _ in range(3):
        _, _, dones, infos = karts.step(np.tile(AHEAD[0], (2, 1)))
    assert dones.all()
    assert all(info["TimeLimit.truncated"] for info in infos)
    assert set(infos[0]["episode"]) == {"r", "l", "furthest", "t"}
    karts.close()


def test_a_term_of_another_discipline_is_refused() -> None:
    with pytest.raises(ScenarioError, match="'progress' is unknown; choose one of near"):
        Batch(near_task(reward="progress"))
    with pytest.raises(ScenarioError, match="'lap' is unknown; choose from near, nearer"):
        Batch(near_task(reward={"lap": 1.0}))
