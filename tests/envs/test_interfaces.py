"""The interfaces that other libraries expect: PettingZoo and Gymnasium."""

import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import NormalizeObservation, RecordEpisodeStatistics
from pettingzoo.env_registry.registration import make
from pettingzoo.test import (
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    render_test,
)

from race_server.envs import registration
from race_server.envs.global_state import names_of
from race_server.envs.parallel import KartRace, env, lot, parallel_env
from race_server.envs.sb3 import KartVecEnv
from race_server.envs.single import OneKart
from race_server.envs.vector import KartVectorEnv
from race_server.errors import ScenarioError
from race_server.scenario.highway import has_highway
from support.tasks import ring_task


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


def test_agents_that_are_cut_off_have_figures_of_their_episodes() -> None:
    race = KartRace(ring_task(2), max_cycles=5)
    race.reset(seed=1)
    total = 0.0
    while race.agents:
        total += race.step(dict.fromkeys(race.agents, np.float32([1.0, 0.0, 0.0])))[1]["kart_0"]
    assert total > 0.0
    assert race.episode_of("kart_0")["r"] == pytest.approx(total, rel=1e-6)
    assert [race.episode_of(agent)["l"] for agent in race.possible_agents] == [5, 5]


@pytest.mark.usefixtures("headless")
def test_the_environment_renders_as_pettingzoo_wants() -> None:
    pytest.importorskip("pygame")
    render_test(lambda render_mode: env(max_cycles=20, render_mode=render_mode))


IDS = [
    name
    for name in registration.MAKERS
    if name != registration.RACETRACK_COMPATIBLE or has_highway()  # it takes its roads
]


@pytest.mark.usefixtures("headless")
@pytest.mark.filterwarnings("ignore:.*A Box observation space")
@pytest.mark.parametrize("name", IDS)
def test_every_environment_keeps_to_gymnasium_and_shows_itself(name: str) -> None:
    pytest.importorskip("pygame")
    made = gymnasium.make(f"race_server:{name}", disable_env_checker=True)
    check_env(made.unwrapped)
    made.close()


@pytest.mark.parametrize("name", [name for name in IDS if registration.MAKERS[name][1]])
def test_every_vector_shows_a_picture_of_each_of_its_worlds(name: str) -> None:
    vector = gymnasium.make_vec(name, num_envs=2, render_mode="rgb_array")
    vector.reset(seed=1)
    pictures = vector.render()
    assert pictures is not None
    assert [picture.shape for picture in pictures] == [(720, 960, 3)] * 2
    vector.close()
    with pytest.raises(ScenarioError, match="choose rgb_array"):
        gymnasium.make_vec(name, num_envs=2, render_mode="human")


@pytest.mark.usefixtures("headless")
def test_vehicles_that_share_a_lot_render_as_pettingzoo_wants() -> None:
    pytest.importorskip("pygame")
    render_test(lambda render_mode: lot(max_cycles=20, render_mode=render_mode))


def test_a_film_plays_as_fast_as_vehicles_decide() -> None:
    karts, vehicles = parallel_env(), lot()
    assert [each.metadata["render_fps"] for each in (karts, vehicles)] == [20, 10]
    kart, car = gymnasium.make("Kart/TimeTrial-v0"), gymnasium.make("Kart/ParkGoal-v0")
    assert [each.metadata["render_fps"] for each in (kart, car)] == [20, 10]
    vector = gymnasium.make_vec("Kart/Park-v0", num_envs=2)
    assert vector.metadata["render_fps"] == 10


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
    assert np.stack(infos["final_obs"]).shape == seen.shape
    assert infos["lap_times"]["l"].tolist() == [4, 4, 4]
    vector.close()


@pytest.mark.parametrize(("num_envs", "worlds"), [(4, 2), (6, 3)])
def test_a_vector_has_as_many_environments_as_asked_for(num_envs: int, worlds: int) -> None:
    vector = gymnasium.make_vec("race_server:Kart/Race-v0", num_envs=num_envs, karts=3, learners=2)
    assert vector.num_envs == num_envs
    assert vector.unwrapped.batch.worlds == worlds
    with pytest.raises(ScenarioError, match="choose a multiple of 2"):
        gymnasium.make_vec("race_server:Kart/Race-v0", num_envs=5, karts=3, learners=2)


def test_a_race_is_made_from_its_options_or_from_a_task() -> None:
    assert parallel_env(karts=3, track="oval").max_num_agents == 3
    assert env(karts=2, track="oval").unwrapped.possible_agents == ["kart_0", "kart_1"]
    with pytest.raises(ScenarioError, match="a task and karts"):
        parallel_env(ring_task(2), karts=3)


def test_a_seed_is_the_same_at_the_beginning_and_afterwards() -> None:
    task = ring_task(1, random_start=True)
    first, later = KartVecEnv(task, seed=3), KartVecEnv(task)
    later.seed(3)
    assert np.array_equal(first.reset(), later.reset())
    assert np.array_equal(first.reset(), later.reset())


NAN = np.array([0.0, np.nan, 0.0], np.float32)


def test_actions_that_are_no_numbers_or_too_many_are_refused() -> None:
    one, vector, race = OneKart(ring_task(1)), KartVectorEnv(ring_task(1), worlds=2), parallel_env()
    for each in (one, vector, race):
        each.reset(seed=1)
    with pytest.raises(ScenarioError, match=r"nan at \[1\].*has diverged"):
        one.step(NAN)
    with pytest.raises(ScenarioError, match=r"shape \(2,\): give \(3,\)"):
        one.step(np.zeros(2))
    with pytest.raises(ScenarioError, match=r"nan at \[1, 0, 1\]"):
        vector.step(np.stack([np.zeros(3), NAN]))
    with pytest.raises(ScenarioError, match=r"shape \(3, 3\): give \(2, 1, 3\)"):
        vector.step(np.zeros((3, 3)))
    with pytest.raises(ScenarioError, match=r"action of kart_2 of shape \(5,\)"):
        race.step({"kart_1": np.zeros(3), "kart_2": np.zeros(5)})
    with pytest.raises(ScenarioError, match=r"nan at \[0, 4, 1\]"):
        race.step({agent: NAN if agent == "kart_4" else np.zeros(3) for agent in race.agents})


@pytest.mark.parametrize("number", [99.0, -1.0, 2.5])
def test_a_discrete_action_that_does_not_exist_is_refused(number: float) -> None:
    task, wrong = ring_task(2, action="discrete"), f"{number:g} at"
    alone = ring_task(1, action="discrete")
    one, vector, race = OneKart(alone), KartVectorEnv(task), KartRace(task)
    for each in (one, vector, race):
        each.reset(seed=1)
    with pytest.raises(ScenarioError, match=f"{wrong} .0.: give a whole number from 0 to 14"):
        one.step(number)
    with pytest.raises(ScenarioError, match=f"{wrong} .0, 1, 0."):
        vector.step(np.array([14, number]))
    with pytest.raises(ScenarioError, match=f"action of kart_1: {wrong}"):
        race.step({"kart_0": 0, "kart_1": number})
    with pytest.raises(ScenarioError, match=f"{wrong} .0, 1, 0."):
        race.step({"kart_0": np.array([0]), "kart_1": np.array([number])})
    karts = KartVecEnv(task)
    karts.reset()
    with pytest.raises(ScenarioError, match=wrong):
        karts.step(np.array([0, number]))
    one.step(14)
    vector.step(np.array([14, 0]))


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_vector_offers_all_modes_of_beginning_again(mode: AutoresetMode) -> None:
    vector = KartVectorEnv(ring_task(1, most_steps=3), worlds=2, autoreset_mode=mode)
    assert vector.metadata["autoreset_mode"] is mode
    first = vector.reset(seed=1)[0]
    ahead = np.tile(np.float32([1.0, 0.0, 0.0]), (2, 1))
    for _ in range(3):
        seen, _, _, cut, infos = vector.step(ahead)
    assert cut.all()
    assert infos["lap_times"]["l"].tolist() == [3, 3]
    if mode is AutoresetMode.SAME_STEP:
        assert np.array_equal(seen, first)
        assert infos["final_info"]["lap_times"]["l"].tolist() == [3, 3]
        return
    assert not np.array_equal(seen, first)
    assert "final_obs" not in infos
    if mode is AutoresetMode.NEXT_STEP:
        seen, rewards, ended, cut, infos = vector.step(ahead)
        assert rewards.tolist() == [0.0, 0.0]
        assert not (ended | cut).any()
    else:
        with pytest.raises(ScenarioError, match="environment 0: its episode is over"):
            vector.step(ahead)
        seen, _ = vector.reset(options={"reset_mask": np.array([True, False])})
        with pytest.raises(ScenarioError, match="environment 1: its episode is over"):
            vector.step(ahead)
        seen, _ = vector.reset(options={"reset_mask": np.array([False, True])})
    assert np.array_equal(seen, first)
    vector.step(ahead)


def test_a_vehicle_that_waits_for_the_others_of_its_lot_is_idle() -> None:
    """The first backs into a wall; the second stands until 5 s are up, 50 decisions."""
    options: dict[str, Any] = {"lot": "gate", "vehicles": 2, "limit_s": 5.0}
    actions, idle, ends = np.float32([[-1.0, 0.0], [0.0, 0.0]]), [], []
    vector = gymnasium.make_vec("Kart/Park-v0", num_envs=2, **options)
    first, _ = vector.reset(seed=1)
    for _ in range(51):
        seen, _, ended, cut, infos = vector.step(actions)
        idle.append(infos["idle"].tolist())
        ends.append((ended | cut).tolist())
        assert infos["_idle"].all()
    crash = ends.index([True, False])
    assert idle == [[False, False]] * (crash + 1) + [[True, False]] * (49 - crash) + [[False] * 2]
    assert ends[49:] == [[False, True], [False, False]]
    assert not np.array_equal(seen, first)


def test_in_a_team_nobody_is_idle_and_alone_nothing_is_told_of_it() -> None:
    options: dict[str, Any] = {"lot": "gate", "vehicles": 2, "limit_s": 5.0, "team": True}
    vector = gymnasium.make_vec("Kart/Park-v0", num_envs=2, **options)
    vector.reset(seed=1)
    for _ in range(50):
        infos = vector.step(np.float32([[-1.0, 0.0], [0.0, 0.0]]))[4]
        assert infos["idle"].tolist() == [False, False]
    alone = gymnasium.make_vec("Kart/Park-v0", num_envs=2, lot="gate")
    alone.reset(seed=1)
    assert alone.step(np.zeros((2, 2), np.float32))[4] == {}


def test_gymnasiums_vector_wrappers_take_it() -> None:
    made = KartVectorEnv(ring_task(1, most_steps=3), worlds=2, autoreset_mode="NextStep")
    vector = NormalizeObservation(RecordEpisodeStatistics(made))
    vector.reset(seed=1)
    for _ in range(3):
        *_, infos = vector.step(np.zeros((2, 3), np.float32))
    assert infos["episode"]["l"].tolist() == [3, 3]


def test_a_vector_shows_a_picture_of_each_race() -> None:
    vector = KartVectorEnv(ring_task(1, random_start=True), worlds=2, render_mode="rgb_array")
    vector.reset(seed=1)
    pictures = vector.render()
    assert pictures is not None
    assert len(pictures) == 2
    assert not np.array_equal(*pictures)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"autoreset_mode": "later"}, "'later' is unknown; choose of NextStep"),
        ({"render_mode": "human"}, "choose rgb_array"),
        ({"autoreset_mode": "Disabled", "learners": 2}, "2 learning karts in each race"),
    ],
)
def test_a_vector_refuses_modes_that_it_has_not(options: dict[str, Any], words: str) -> None:
    learners = options.pop("learners", 1)
    with pytest.raises(ScenarioError, match=words):
        KartVectorEnv(ring_task(learners), **options)


def test_the_state_of_a_race_shows_karts_that_no_agent_drives() -> None:
    race = KartRace(ring_task(3, opponents=("pure_pursuit",), learners=1))
    race.reset(seed=1)
    names, state = names_of(race.batch.world), race.state()
    assert race.state_space.contains(state)
    assert len(names) == len(state)
    assert state[names.index("kart_2.x")] == np.float32(race.batch.world.bodies["x"][0, 2])
    assert state[names.index("kart_2.rank")] == 3.0


def test_discrete_actions_have_masks_in_every_form() -> None:
    task = ring_task(2, action="discrete")
    race = KartRace(task)
    _, infos = race.reset(seed=1)
    assert infos["kart_1"]["action_mask"].tolist() == [1] * 15
    karts = KartVecEnv(task)
    karts.batch.buffers.idle[0, 1] = 1  # as one that is done waits for the other
    masks = karts.env_method("action_masks")
    assert masks[0].all()
    assert np.flatnonzero(masks[1]).tolist() == [7]
    assert np.array_equal(KartVectorEnv(task).action_masks(), np.ones((2, 15)))
    with pytest.raises(ScenarioError, match="have no masks"):
        OneKart(ring_task(1)).action_masks()


def test_parts_of_an_observation_may_come_as_a_list() -> None:
    """Configurations of other libraries hold lists."""
    kart = gymnasium.make(
        "Kart/TimeTrial-v0", track="oval", observation=["lidar", "speed"], disable_env_checker=True
    )
    assert kart.observation_space.shape == (202,)
