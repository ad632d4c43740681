"""The training world: one race among many, and the interfaces that people's code expects."""

import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.env_registry.registration import make
from pettingzoo.test import (
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    render_test,
)

from race_server.core import codes
from race_server.core.driver import driver_named
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.envs.actions import discrete_table
from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER, RESET_WORLD, STAY
from race_server.envs.parallel import KartRace, env, parallel_env
from race_server.envs.presets import race_task, task_on, time_trial_task
from race_server.envs.racing.reward_terms import REWARDS, TERMS, reward_weights
from race_server.envs.reality_gap import RealityGap
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.live.local_drivers import briefing_for
from race_server.scenario.race import Scenario
from race_server.scenario.sensors import Lidar
from race_server.scenario.track.reverse import reversed_course
from race_server.session import Session
from support.courses import SMALL_RING
from support.tasks import FREE, ring_task


def wandering(batch: Batch, steps: int, seed: int = 3) -> list[np.ndarray]:
    chance = np.random.default_rng(seed)
    shape = batch.buffers.actions[0].shape
    return [chance.uniform(-1.0, 1.0, shape).astype(np.float32) for _ in range(steps)]


# One race among many


def test_world_17_of_64_is_the_same_world_alone_for_5000_ticks() -> None:
    task = race_task(karts=3, opponents=("avoider",), learners=2, most_steps=200)
    many = Batch(task, worlds=64, seed=100, after=RESET_WORLD)
    alone = Batch(task, worlds=1, seed=117, after=RESET_WORLD)
    for actions in wandering(alone, 1667):
        many.buffers.actions[:] = actions
        many.step()
        alone.step(actions)
    assert many.buffers.rounds["number"][17] > 3
    assert many.digest(17) == alone.digest()
    assert np.array_equal(many.observations[17], alone.observations[0])
    assert many.digest(16) != alone.digest()


def test_threads_do_not_change_what_happens() -> None:
    one, two = (Batch(ring_task(random_start=True), worlds=5, threads=n) for n in (1, 2))
    for actions in wandering(one, 60):
        for batch in (one, two):
            batch.buffers.actions[:] = actions
            batch.step()
    assert [one.digest(w) for w in range(5)] == [two.digest(w) for w in range(5)]
    two.close()


def test_the_batch_runs_the_very_race_that_a_live_session_runs() -> None:
    names = ("follow_gap", "pure_pursuit", "avoider")
    scenario = Scenario(SMALL_RING, karts=4, rules=replace(FREE, items=True))
    task = task_on((scenario,), opponents=names, learners=1, observation="lidar")
    batch = Batch(task, after=STAY)
    seed = int(batch.world.races["seed"][0])
    session = Session("race", replace(scenario, seed=seed))
    drivers = {}
    session.join("learner", "lidar", wanted=0).is_ready = True
    for seat, name in enumerate(names, start=1):
        driver = driver_named(name)
        taken = session.join(name, driver.preset, wanted=seat)
        taken.is_ready = True
        driver.reset(briefing_for(session, taken))
        drivers[seat] = driver
    session.start()
    for decision in range(200):
        drive = 0.4 if decision % 40 < 30 else 0.0
        batch.step(np.array([[[drive, 0.1, 0.0]]]))
        session.observe()
        seen = {
            seat: Observation(session.tick, session.layout(driver.preset), session.view(seat))
            for seat, driver in drivers.items()
        }
        controls = {seat: driver.act(seen[seat]) for seat, driver in drivers.items()}
        steering, throttle = np.float32(0.1), np.float32(drive)
        controls[0] = Control(float(steering), float(throttle))
        for seat, control in controls.items():
            session.receive_control(seat, session.epoch, decision + 1, session.tick, control)
        session.advance(3)
    session.observe()
    # A session also numbers its own events; all else is the same to the bit.
    session.world.races["sequence"] = batch.world.races["sequence"]
    assert session.digest() == batch.digest()
    assert np.array_equal(session.view(0), batch.observations[0, 0])


# Ends and resets


def crash_task(karts: int = 3) -> Task:
    return ring_task(karts, replace(FREE, wall_contact="retire"), most_steps=400)


def crash_first(batch: Batch) -> np.ndarray:
    """Kart 0 drives straight into the wall, the others stand still."""
    actions = np.zeros_like(batch.buffers.actions[0])
    actions[0, 0] = 1.0
    return actions


def test_a_kart_that_retires_early_gets_one_end_with_its_last_observation() -> None:
    batch = Batch(crash_task(), after=STAY)
    ends, last = [], None
    for step in range(200):
        batch.step(crash_first(batch))
        ends += [(step, kart) for kart in np.flatnonzero(batch.terminated[0])]
        if batch.terminated[0, 0]:
            last = batch.terminal[0, 0].copy()
    assert [kart for _, kart in ends] == [0]
    assert last is not None
    assert np.array_equal(last, batch.observations[0, 0])
    assert batch.world.racers["retired_for"][0, 0] == codes.CRASH
    assert batch.rewards[0, 0] == 0.0


def test_the_others_race_on_after_an_early_end() -> None:
    race = KartRace(crash_task())
    race.reset(seed=1)
    ended: list[str] = []
    for _ in range(200):
        actions = {agent: np.array([1.0 * (agent == "kart_0"), 0.0, 0.0]) for agent in race.agents}
        _, _, over, _, infos = race.step(actions)
        ended += [agent for agent, is_over in over.items() if is_over]
    assert ended == ["kart_0"]
    assert race.agents == ["kart_1", "kart_2"]
    assert infos["kart_1"]["reward_terms"]["time"] == 1.0


def test_a_kart_reenters_the_race_that_goes_on_without_it() -> None:
    batch = Batch(crash_task(), after=REENTER)
    tick = 0
    for _ in range(100):
        batch.buffers.memory[:] = 7.0
        batch.step(crash_first(batch))
        if batch.terminated[0, 0]:
            break
        tick = int(batch.world.races["tick"][0])
    assert not batch.buffers.memory[0, 0].any()
    assert batch.buffers.memory[0, 1].all()
    assert batch.terminated[0].tolist() == [1, 0, 0]
    assert batch.world.races["tick"][0] == tick + 3
    assert batch.world.bodies["status"][0, 0] == codes.RACING
    assert batch.buffers.episodes["steps"][0, 0] == 0
    assert batch.buffers.ended["crashes"][0, 0] == 1
    assert not np.array_equal(batch.terminal[0, 0], batch.observations[0, 0])


def test_time_that_runs_out_cuts_an_episode_off() -> None:
    batch = Batch(ring_task(most_steps=5), after=RESET_WORLD)
    cuts = []
    for _ in range(10):
        batch.step(np.zeros((1, 2, 3)))
        cuts.append(batch.truncated[0].tolist())
    assert cuts == ([[0, 0]] * 4 + [[1, 1]]) * 2
    assert not batch.terminated.any()
    assert batch.buffers.rounds["number"][0] == 3


def test_the_same_seed_gives_the_same_race_and_another_seed_another() -> None:
    batch = Batch(ring_task(random_start=True))
    first, again = batch.reset(5).copy(), batch.reset(5).copy()
    other, later = batch.reset(6).copy(), batch.reset().copy()
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert not np.array_equal(other, later)


EPISODE = """
from race_server.envs.parallel import parallel_env
import numpy as np
race = parallel_env(max_cycles=400)
race.reset(seed=42)
chance = np.random.default_rng(0)
while race.agents:
    race.step({agent: chance.uniform(-1, 1, 3).astype(np.float32) for agent in race.agents})
print(race.batch.digest())
"""


def test_a_whole_episode_repeats_in_another_process() -> None:
    digests = {
        subprocess.run(
            [sys.executable, "-c", EPISODE],
            env={**os.environ, "PYTHONHASHSEED": str(number)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for number in range(2)
    }
    assert len(digests) == 1
    assert len(digests.pop().strip()) == 32


# Starts and scenarios


def test_random_starts_are_on_the_track_and_apart() -> None:
    batch = Batch(ring_task(6, random_start=True), worlds=20)
    assert (np.abs(batch.world.racers["lateral_offset"]) < 0.6).all()
    for bodies in batch.world.bodies:
        places = np.stack([bodies["x"], bodies["y"]], axis=1)
        gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
        assert gaps[~np.eye(6, dtype=bool)].min() > 0.45


def test_random_starts_on_a_shipped_track_face_the_direction_of_travel() -> None:
    batch = Batch(race_task(random_start=True), worlds=20)
    assert (np.abs(batch.world.racers["heading_error"]) < 0.6).all()


def test_a_share_of_the_rounds_begins_at_random_places() -> None:
    grid = Batch(ring_task(3)).world.bodies["x"][0]
    begun = Batch(ring_task(3, random_start=0.5), worlds=60).world.bodies["x"]
    on_grid = (begun == grid).all(axis=1)
    assert 15 < on_grid.sum() < 45
    assert not (begun[~on_grid] == grid).any()


def test_who_is_stuck_is_put_back_without_asking() -> None:
    task = ring_task(1, replace(FREE, stuck_s=0.5), action="continuous")
    batch = Batch(task, after=STAY)
    for _ in range(20):
        batch.step(np.zeros((1, 1, 3)))
    assert batch.world.bodies["ghost_until"][0, 0] > 0


def test_every_round_begins_in_an_order_on_the_grid_that_is_drawn() -> None:
    batch = Batch(ring_task(6, random_grid=True), worlds=20, seed=3)
    places = batch.world.racers["grid_place"].copy()
    assert (np.sort(places, axis=1) == np.arange(6)).all()
    assert len(np.unique(places, axis=0)) > 15
    first = np.take_along_axis(batch.world.racers["ranked"], np.argsort(places, axis=1), axis=1)
    assert (np.diff(first, axis=1) < 0.0).all()
    batch.reset()
    assert not np.array_equal(places, batch.world.racers["grid_place"])
    assert np.array_equal(
        places, Batch(ring_task(6, random_grid=True), worlds=20, seed=3).world.racers["grid_place"]
    )


def test_all_karts_of_a_race_start_in_the_same_of_two_directions() -> None:
    batch = Batch(ring_task(4, random_start=True, both_directions=True), worlds=40)
    bodies, racers = batch.world.bodies, batch.world.racers
    # Around the origin, counter-clockwise is where position and heading turn left.
    turn = np.sign(
        bodies["x"] * np.sin(bodies["heading"]) - bodies["y"] * np.cos(bodies["heading"])
    )
    assert (turn == turn[:, :1]).all()
    assert set(turn[:, 0]) == {-1.0, 1.0}
    assert (np.abs(racers["heading_error"]) < 0.3).all()


def test_a_course_driven_the_other_way_round_twice_is_the_course() -> None:
    twice = reversed_course(reversed_course(SMALL_RING))
    assert np.allclose(twice.line[:, [0, 1, 3]], SMALL_RING.line[:, [0, 1, 3]])
    assert np.allclose(twice.gates, SMALL_RING.gates)
    assert np.allclose(twice.grid[:, :2], SMALL_RING.grid[:, :2], atol=0.02)
    assert twice.sectors == SMALL_RING.sectors


def test_a_curriculum_decides_which_scenario_a_reset_draws() -> None:
    short, long = (Scenario(SMALL_RING, karts=2, rules=replace(FREE, laps=n)) for n in (1, 9))
    batch = Batch(task_on((short, long)), worlds=30)
    assert set(batch.world.rules["laps"]) == {1, 9}
    batch.set_odds([0.0, 1.0])
    batch.reset()
    assert set(batch.world.rules["laps"]) == {9}
    with pytest.raises(ScenarioError, match=r"give one for each of the 2 scenarios"):
        batch.set_odds([1.0])


# Actions, rewards, the reality gap


def test_progress_is_the_distance_driven() -> None:
    batch = Batch(ring_task(1, reward={"progress": 2.0}))
    begun = float(batch.world.racers["distance"][0, 0])
    total = 0.0
    for _ in range(40):
        batch.step([[[0.5, 0.05, 0.0]]])
        total += float(batch.rewards[0, 0])
    assert total == pytest.approx(2.0 * (batch.world.racers["distance"][0, 0] - begun), rel=1e-5)
    assert total > 1.0


def test_the_reward_of_the_report_is_12_times_the_range_plus_3_times_the_speed() -> None:
    task = ring_task(1, observation="report_b", reward="report_b", action="report_b")
    batch = Batch(task)
    batch.step([[[0.0, 0.0]]])
    near = float(batch.observations[0, 0, :201].min())
    speed = float(batch.world.bodies["speed"][0, 0])
    assert batch.rewards[0, 0] == pytest.approx(12.0 * near + 3.0 * speed, rel=1e-5)


def test_a_range_below_the_limit_is_a_crash_that_costs_300() -> None:
    task = ring_task(1, observation="report_b", reward="report_b", crash_range=0.12)
    batch = Batch(task, after=STAY)
    for _ in range(200):
        batch.step([[[1.0, 0.0, 0.0]]])
        if batch.terminated[0, 0]:
            break
    assert batch.rewards[0, 0] == -300.0


def test_an_increment_of_one_adds_half_a_metre_per_second_and_nine_degrees() -> None:
    batch = Batch(ring_task(1, action="report_b"))
    batch.step([[[1.0, 0.5]]])
    assert batch.buffers.commanded[0, 0, :2] == pytest.approx([0.5, np.radians(4.5)])
    batch.step([[[1.0, -0.5]]])
    assert batch.buffers.commanded[0, 0, :2] == pytest.approx([1.0, 0.0])


@pytest.mark.parametrize(("action", "slower"), [("increments", 0.5), ("report_b", 1.0)])
def test_only_plain_increments_take_speed_away_again(action: str, slower: float) -> None:
    batch = Batch(ring_task(1, action=action))
    batch.step([[[1.0, 0.0]]])
    batch.step([[[1.0, 0.0]]])
    batch.step([[[-1.0, 0.0]]])
    assert batch.buffers.commanded[0, 0, 0] == pytest.approx(slower)


def test_a_discrete_action_is_a_row_of_the_table() -> None:
    batch = Batch(ring_task(1, action="discrete"))
    row = int(np.flatnonzero((discrete_table() == (1.0, 0.5, 0.0)).all(axis=1))[0])
    batch.step([[[row]]])
    assert batch.buffers.controls[0, 0, :2] == pytest.approx([0.5, 1.0])


def test_a_control_as_action_reaches_the_kart_as_it_is() -> None:
    batch = Batch(ring_task(1, action="control"))
    batch.step([[[0.25, -0.5, 0.125, 2.0]]])
    body = batch.world.bodies[0, 0]
    assert batch.buffers.controls[0, 0].tolist() == [0.25, -0.5, 0.125, 2.0]
    assert (body.steering_command, body.throttle, body.brake) == (0.25, -0.5, 0.125)
    assert body.buttons == codes.ACCEPT_RESCUE


def test_an_action_that_is_delayed_by_two_decisions_acts_two_decisions_later() -> None:
    batch = Batch(ring_task(1, gap=RealityGap(action_delay=(2, 2))))
    steering = []
    for command in (0.1, 0.2, 0.3, 0.4):
        batch.step([[[0.0, command, 0.0]]])
        steering.append(batch.buffers.controls[0, 0, 0])
    assert steering == pytest.approx([0.0, 0.0, 0.1, 0.2])


def test_delays_are_rounded_to_decisions() -> None:
    gap = RealityGap(action_delay=(0.4, 1.6), actuator_lag=(0.4, 1.6))
    assert gap.ranges()[:3].tolist() == [[0.0, 2.0], [0.0, 0.0], [0.4, 1.6]]


def test_an_observation_that_is_delayed_is_that_of_earlier() -> None:
    late = Batch(ring_task(1, gap=RealityGap(observation_delay=(1, 1))))
    prompt = Batch(ring_task(1))
    before = prompt.observations.copy()
    for _ in range(5):
        for batch in (late, prompt):
            batch.step([[[0.7, 0.1, 0.0]]])
        assert np.array_equal(late.observations, before)
        before = prompt.observations.copy()


def test_lag_follows_an_exponential_and_play_swallows_small_moves() -> None:
    lagging = Batch(ring_task(1, gap=RealityGap(actuator_lag=(0.05, 0.05))))
    lagging.step([[[0.0, 1.0, 0.0]]])
    assert lagging.buffers.controls[0, 0, 0] == pytest.approx(1.0 - np.exp(-1.0))
    loose = Batch(ring_task(1, gap=RealityGap(steering_play=(0.2, 0.2))))
    followed = []
    for command in (0.05, 0.5, 0.45, 0.2):
        loose.step([[[0.0, command, 0.0]]])
        followed.append(loose.buffers.controls[0, 0, 0])
    assert followed == pytest.approx([0.0, 0.4, 0.4, 0.3])


def test_a_lidar_with_drop_outs_loses_its_share_of_rays() -> None:
    batch = Batch(time_trial_task("oval", lidar=Lidar(dropout=0.3, noise=0.05)), worlds=50)
    assert (batch.observations[..., :201] == 0.0).mean() == pytest.approx(0.3, abs=0.02)


def test_mass_grip_and_battery_are_drawn_for_each_episode_and_logged() -> None:
    gap = RealityGap(mass=(0.9, 1.1), grip=(0.8, 1.0), speed_coefficient=(0.5, 0.6))
    batch = Batch(ring_task(1, gap=gap), worlds=50)
    nominal = batch.task.scenarios[0].vehicle_of(0)
    draws = [batch.draws(w, 0) for w in range(50)]
    assert len({draw["mass"] for draw in draws}) == 50
    assert all(0.9 <= draw["mass"] <= 1.1 and 0.8 <= draw["grip"] <= 1.0 for draw in draws)
    mass = batch.world.vehicles["mass"][:, 0]
    assert mass == pytest.approx([nominal.mass * draw["mass"] for draw in draws])
    batch.reset()
    assert batch.draws(0, 0) != draws[0]
    assert batch.world.vehicles["top_speed"].max() <= 0.6 * nominal.top_speed


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reward": "fun"}, "reward 'fun' is unknown; choose one of progress, race"),
        ({"reward": {"glory": 1.0}}, "reward term 'glory' is unknown; choose from progress"),
        ({"action": "telepathy"}, "action 'telepathy' is unknown; choose one of continuous"),
        ({"observation": "everything"}, "observation 'everything' is unknown; choose one of"),
        ({"observation": ("speed", "speed")}, "each once"),
        ({"learners": 3}, "3 learning karts of 2: choose 1 to 2"),
        ({"learners": 1}, "name opponents for the others"),
        ({"gap": RealityGap(grip=(1.0, 0.5))}, "reality gap grip from 1 to 0.5"),
    ],
)
def test_a_task_that_makes_no_race_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        Batch(ring_task(**options))


def test_every_reward_table_weighs_known_terms() -> None:
    for name in REWARDS:
        assert len(reward_weights(name)) == len(TERMS)
        assert reward_weights(name).any()


# Interfaces


@pytest.fixture
def headless(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def test_the_parallel_environment_keeps_to_pettingzoo() -> None:
    parallel_api_test(parallel_env(max_cycles=120), num_cycles=300)
    parallel_seed_test(parallel_env)


def test_the_turn_based_environment_keeps_to_pettingzoo() -> None:
    api_test(env(max_cycles=60), num_cycles=300, verbose_progress=False)


def test_the_number_of_cycles_is_kept() -> None:
    class Module:
        env = staticmethod(env)
        parallel_env = staticmethod(parallel_env)

    max_cycles_test(Module)


@pytest.mark.usefixtures("headless")
def test_the_environment_renders_as_pettingzoo_wants() -> None:
    pytest.importorskip("pygame")
    render_test(lambda render_mode: env(max_cycles=20, render_mode=render_mode))


@pytest.mark.parametrize("name", ["Kart/TimeTrial-v0", "Kart/Race-v0"])
def test_the_single_environments_keep_to_gymnasium(name: str) -> None:
    made = gymnasium.make(f"race_server:{name}")
    check_env(made.unwrapped, skip_render_check=True)
    made.close()


def test_pettingzoo_makes_the_race_by_its_id() -> None:
    race = make("parallel", "Kart/Race-v0", task=ring_task(3))
    assert race.unwrapped.possible_agents == ["kart_0", "kart_1", "kart_2"]
    assert make("aec", "Kart/Race-v0", task=ring_task(2)).possible_agents == ["kart_0", "kart_1"]


def test_gymnasium_finds_the_ids_in_a_fresh_process() -> None:
    code = "import gymnasium as gym; gym.make('race_server:Kart/TimeTrial-v0').reset(seed=1)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_gymnasium_makes_a_vector_environment_on_one_batch() -> None:
    vector = gymnasium.make_vec(
        "race_server:Kart/Race-v0", num_envs=6, vectorization_mode="vector_entry_point", karts=3
    )
    seen, _ = vector.reset(seed=1)
    assert seen.shape == vector.observation_space.shape == (6, seen.shape[1])
    seen, rewards, ended, cut, _ = vector.step(vector.action_space.sample())
    assert rewards.shape == ended.shape == cut.shape == (6,)
    vector.close()


def test_a_vector_environment_hands_over_the_last_observation() -> None:
    vector = gymnasium.make_vec(
        "race_server:Kart/TimeTrial-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        most_steps=4,
    )
    vector.reset(seed=1)
    for _ in range(4):
        seen, _, ended, cut, infos = vector.step(np.zeros((3, 3), np.float32))
    assert (ended | cut).all()
    assert infos["final_obs"].shape == seen.shape
    assert infos["episode"]["l"].tolist() == [4, 4, 4]
    vector.close()
