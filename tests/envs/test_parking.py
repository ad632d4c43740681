"""Parking as a discipline of the training world."""

import math
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from pettingzoo.test import parallel_api_test

from race_server.envs import registration
from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER, STAY
from race_server.envs.parallel import parallel_lot
from race_server.envs.parking import reward_terms
from race_server.envs.parking.goal import CRASH, METRES
from race_server.envs.parking.reward_terms import ENDINGS, TERMS
from race_server.envs.presets import parking_task
from race_server.errors import ScenarioError

AHEAD, BACK, STAND = (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0)


def face_to_face(**options: object) -> Batch:
    """Return a kart whose slot is straight ahead, 5 m from middle to middle."""
    return Batch(parking_task("face-to-face", **options), after=STAY)


def drive(batch: Batch, action: tuple[float, float], decisions: int) -> float:
    """Drive on until the episode is over; return what that was worth."""
    total = 0.0
    for _ in range(decisions):
        batch.step(np.array(action, np.float32))
        total += float(batch.rewards[0, 0])
        if batch.buffers.idle[0, 0]:
            break
    return total


def test_every_term_has_the_number_of_its_place() -> None:
    assert [getattr(reward_terms, name.upper()) for name in TERMS] == list(range(len(TERMS)))


def test_a_kart_that_drives_straight_ahead_parks_in_the_slot_before_it() -> None:
    batch = face_to_face(reward={"parked": 1.0, "goal_progress": 1.0})
    total = drive(batch, AHEAD, 100)
    episode = batch.episode_of(0, 0)
    assert episode["is_success"]
    assert episode["aligned"]
    assert episode["ending"] == "parked"
    assert episode["direction_changes"] == 0
    # Closer than 0.5 m is parked: it has driven the 4.5 m before that, and a tick more at most.
    assert 4.5 < episode["path_m"] < 4.6
    # The way counts the speed at the end of each tick, which is a little more while it gains speed.
    assert total == pytest.approx(1.0 + episode["path_m"], abs=0.02)


def test_a_kart_that_reverses_meets_the_wall_behind_it() -> None:
    batch = face_to_face(reward={"crash": -1.0, "reversing": -60.0})
    total = drive(batch, BACK, 100)
    episode = batch.episode_of(0, 0)
    assert episode["ending"] == "wall"
    # A share of 60 s for each decision of 0.1 s, all of them in reverse.
    assert total == pytest.approx(-1.0 - 0.1 * episode["l"], abs=1e-3)
    assert episode["reversed_m"] == episode["path_m"]


def test_a_touch_counts_where_it_ends_nothing_and_a_crash_where_it_does() -> None:
    reward = {"touch": -1.0, "crash": -5.0}
    assert drive(face_to_face(reward=reward), BACK, 100) == -5.0
    task = parking_task("face-to-face", reward=reward)
    (scenario,) = task.scenarios
    rules = replace(scenario.rules, wall_contact="bump", kart_contact="bump")
    batch = Batch(replace(task, scenarios=(replace(scenario, rules=rules),)), after=STAY)
    rewards = []
    while 0.0 not in rewards[1:]:  # until the decision after the first touch
        batch.step(np.array(BACK, np.float32))
        rewards += [float(batch.rewards[0, 0])] if rewards or batch.rewards[0, 0] else []
    assert rewards[0] == -1.0
    assert not batch.buffers.idle[0, 0]


def test_a_person_who_is_run_into_is_a_touch_once() -> None:
    task = parking_task("yard-70", reward={"touch": -1.0, "person": -5.0})
    (scenario,) = task.scenarios
    for contact, worth in (("bump", [-1.0, 0.0, 0.0]), ("retire", [-5.0, 0.0, 0.0])):
        rules = replace(scenario.rules, wall_contact=contact)
        batch = Batch(replace(task, scenarios=(replace(scenario, rules=rules),)), after=STAY)
        batch.step(np.array(AHEAD, np.float32))
        assert batch.rewards[0, 0] == 0.0
        walker, body = batch.world.parking.walkers[0, 0], batch.world.bodies[0, 0]
        walker["x"], walker["y"] = body["x"], body["y"]
        rewards = []
        for _ in range(3):
            batch.step(np.array(AHEAD, np.float32))
            rewards.append(float(batch.rewards[0, 0]))
        assert rewards == worth


@pytest.mark.parametrize("late_ends", [False, True])
def test_time_that_runs_out_is_a_cut_unless_the_task_calls_it_an_end(late_ends: bool) -> None:
    batch = face_to_face(limit_s=2.0, reward={"late": -1.0}, late_ends=late_ends)
    assert drive(batch, STAND, 30) == -1.0
    assert batch.episode_of(0, 0)["l"] == 20
    assert bool(batch.terminated[0, 0]) is late_ends
    assert bool(batch.truncated[0, 0]) is not late_ends


def test_the_goal_is_seen_5_metres_ahead_and_in_the_frame_of_the_lot() -> None:
    batch = face_to_face()
    seen = {name: batch.observations[0, 0][place] for name, place in batch.layout.slices.items()}
    assert seen["goal_x"][0] == pytest.approx(5.0)
    assert seen["goal_y"][0] == pytest.approx(0.0)
    assert seen["goal_cos"][0] == pytest.approx(1.0)
    assert seen["goal_proximity"][0] == pytest.approx(1.0 / 6.0)
    # The wall is 16 m from the middle of the body; the radar sits at the centre of gravity.
    assert seen["radar"][4] == pytest.approx(16.0, abs=0.2)


def test_unit_vectors_tell_neither_how_far_the_slot_is_nor_how_fast_a_kart_drives() -> None:
    batch = face_to_face(observation="report_a_2_unit")
    seen = {name: batch.observations[0, 0, place] for name, place in batch.layout.slices.items()}
    assert seen["to_slot_unit"] == pytest.approx([1.0, 0.0])
    assert seen["slot_unit"] == pytest.approx([1.0, 0.0])
    assert list(seen["velocity_unit"]) == [0.0, 0.0]  # it stands
    for _ in range(10):
        batch.step(np.array(AHEAD, np.float32))
        ahead = [seen[name][0] for name in ("velocity_unit", "to_slot_unit", "position_unit")]
        assert ahead == pytest.approx([1.0, 1.0, 1.0])


def test_a_minute_70_metres_away_costs_1_as_a_share_of_the_yard_and_70_in_metres() -> None:
    batch = face_to_face(reward="report_a_share", limit_s=6.0)
    # It stands 5 m away until the time is up, which costs 1 besides.
    assert drive(batch, STAND, 100) == pytest.approx(-1.0 - 5.0 / 70.0)
    batch = face_to_face(reward="report_a_distance", limit_s=6.0)
    assert drive(batch, STAND, 100) == pytest.approx(-1.0 - 5.0)


def test_worlds_of_a_batch_park_as_each_would_alone() -> None:
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 4, 1, 2)).astype(np.float32)
    many = Batch(parking_task("yard-70"), worlds=4, seed=7)
    alone = Batch(parking_task("yard-70"), worlds=1, seed=9)
    for row in actions:
        many.step(row)
        alone.step(row[2:3])
    assert many.digest(2) == alone.digest()
    assert np.array_equal(many.observations[2], alone.observations[0])


def test_the_reward_of_goals_is_a_plain_function_of_them() -> None:
    for kind in ("sparse", "dense"):
        env = gymnasium.make(registration.PARK_GOAL, reward=kind, disable_env_checker=True)
        seen, _ = env.reset(seed=3)
        achieved, desired = [], []
        rewards, infos = [], []
        for _ in range(40):
            seen, reward, is_over, is_cut, info = env.step(env.action_space.sample())
            achieved.append(seen["achieved_goal"])
            desired.append(seen["desired_goal"])
            rewards.append(reward)
            infos.append(info)
            if is_over or is_cut:
                env.reset()
        again = env.unwrapped.compute_reward(np.array(achieved), np.array(desired), infos)  # type: ignore[attr-defined]
        assert again.tolist() == rewards


@pytest.mark.parametrize("kind", ["sparse", "dense"])
def test_the_infos_of_a_vector_tell_of_crashes_as_those_of_each_step_do(kind: str) -> None:
    vector = gymnasium.make_vec(registration.PARK_GOAL, 3, vectorization_mode="sync", reward=kind)
    vector.reset(seed=1)
    for _ in range(100):
        seen, rewards, is_over, is_cut, infos = vector.step(np.array([[-1.0, 0.0]] * 3, np.float32))
        one: Any = vector.envs[0].unwrapped  # type: ignore[attr-defined]
        again = one.compute_reward(seen["achieved_goal"], seen["desired_goal"], infos)
        assert again.tolist() == rewards.tolist()
        if (is_over | is_cut).any():
            break
    assert (rewards < -20.0).any()  # a wall is behind the starts


@pytest.mark.parametrize("discount", [math.nan, math.inf, -0.1, 1.5])
def test_a_discount_is_a_share(discount: float) -> None:
    with pytest.raises(ScenarioError, match=rf"discount = {discount:g}: choose 0 to 1"):
        parking_task("face-to-face", shaping="potential", discount=discount)


@pytest.mark.parametrize("flag", ["team", "late_ends"])
def test_a_word_is_no_flag(flag: str) -> None:
    with pytest.raises(ScenarioError, match=f"{flag} = 'yes': choose True or False"):
        parking_task("face-to-face", **{flag: "yes"})


def test_a_flag_is_no_number_of_vehicles() -> None:
    task = parking_task("gate", vehicles=True)
    with pytest.raises(ScenarioError, match="True: choose a whole number, 1 to 64"):
        Batch(task)


def test_a_goal_is_reached_within_half_a_metre_and_10_degrees() -> None:
    env = gymnasium.make(registration.PARK_GOAL, disable_env_checker=True).unwrapped
    goal = np.array([1.0, 2.0, 1.0, 0.0, 0.0])

    def reward(x: float, degrees: float, **info: object) -> float:
        turn = np.radians(degrees)
        pose = np.array([1.0 + x / METRES, 2.0, np.cos(turn), np.sin(turn), 0.3])
        return float(env.compute_reward(pose, goal, info))  # type: ignore[attr-defined]

    assert reward(0.4, 9.0) == 0.0
    assert reward(0.6, 0.0) == -1.0
    assert reward(0.0, 11.0) == -1.0
    assert reward(0.0, 180.0) == -1.0
    assert reward(0.6, 0.0, crashed=True) == -1.0 + CRASH


def test_goals_may_be_lists_and_what_is_no_goal_is_refused() -> None:
    env: Any = gymnasium.make(registration.PARK_GOAL, disable_env_checker=True).unwrapped
    goal = [1.0, 2.0, 1.0, 0.0, 0.0]
    assert env.compute_reward(
        [goal, goal], [goal, goal], [{"crashed": False}, {"crashed": True}]
    ).tolist() == [*(0.0, CRASH)]
    with pytest.raises(ScenarioError, match=r"info 0 has no 'crashed'.*copy_info_dict=True"):
        env.compute_reward([goal, goal], [goal, goal], [{}, {"crashed": True}])
    with pytest.raises(
        ScenarioError, match=r"achieved goals \[1.0\]: give finite numbers of the shape"
    ):
        env.compute_reward(goal[:1], goal, {})
    with pytest.raises(ScenarioError, match=r"desired goals .*: give finite numbers of the shape"):
        env.compute_reward(goal, [goal, goal[:4]], {})
    with pytest.raises(ScenarioError, match=r"infos = None: give that of each step"):
        env.compute_reward(goal, goal, None)
    with pytest.raises(ScenarioError, match=r"infos = 'abc': give that of each step, a dict"):
        env.compute_reward(goal, goal, "abc")
    with pytest.raises(ScenarioError, match=r"1 infos for rewards of the shape \(3,\)"):
        env.compute_reward([goal] * 3, [goal] * 3, [{"crashed": True}])
    with pytest.raises(ScenarioError, match=r"achieved goals of the shape \(3, 5\), desired"):
        env.compute_reward([goal] * 3, [goal] * 2, {})
    with pytest.raises(ScenarioError, match=r"achieved goals .*: give finite numbers"):
        env.compute_reward([np.nan] * 5, goal, {})


@pytest.mark.filterwarnings("error")
def test_an_action_far_out_of_its_range_is_the_nearest_one_in_it() -> None:
    ends = []
    for much in (1.0, 1e30, 3e38):
        env = gymnasium.make(registration.PARK, disable_env_checker=True)
        env.reset(seed=1)
        ends.append(env.step(np.array([much, 0.0], np.float32))[0])
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0], ends[2])


def test_pettingzoo_finds_nothing_wrong_with_vehicles_that_park() -> None:
    parallel_api_test(parallel_lot(vehicles=3), num_cycles=60)


def test_a_vehicle_that_is_done_leaves_the_agents_and_stays_in_the_way() -> None:
    env = parallel_lot(vehicles=2)
    env.reset(seed=1)
    while len(env.agents) == 2:
        env.step(dict.fromkeys(env.agents, np.array([1.0, 0.0], np.float32)))
    gone = next(k for k in range(2) if f"kart_{k}" not in env.agents)
    assert env.episode_of(f"kart_{gone}")["ending"] in ENDINGS[1:]
    assert env.batch.world.parking.blocks["kind"][0, gone] > 0


def test_a_reward_for_goals_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"'dnse': choose one of sparse, dense"):
        gymnasium.make(registration.PARK_GOAL, reward="dnse")


# With a trailer


def lorry_in_bay(level: str = "dock", **options: object) -> Batch:
    """Return a lorry at a dock."""
    task = parking_task("dock-35", level=level, observation="park_trailer", **options)
    return Batch(task, after=STAY)


def test_a_lorry_that_bends_its_hitch_too_far_pays_for_a_jack_knife_and_for_no_crash() -> None:
    batch = lorry_in_bay(reward={"jack_knife": -3.0, "crash": -100.0})
    batch.world.bodies["trailers"]["heading"][0, 0, 0] += 3.0
    batch.step(np.array(STAND, np.float32))
    assert batch.rewards[0, 0] == -3.0
    assert batch.episode_of(0, 0)["ending"] == "jack_knife"


def test_at_a_dock_metres_are_gained_by_the_trailer() -> None:
    batch = lorry_in_bay(reward={"goal_progress": 1.0})
    parker, body = batch.world.parking.parkers[0, 0], batch.world.bodies[0, 0]
    # Straight before its bay, the middle of the trailer 10 m from where it belongs.
    body.x, body.heading = parker.x, 0.5 * np.pi
    body.y = parker.y - 1.45 + 6.45 + 10.0
    body.trailers["heading"] = 0.5 * np.pi
    drive(batch, STAND, 1)  # from here on
    total = drive(batch, BACK, 20)
    assert total == pytest.approx(batch.world.parking.parkers["reversed"][0, 0], abs=0.01)
    assert total > 0.5


def test_the_reward_of_the_report_adds_up_to_its_figures() -> None:
    batch = Batch(parking_task("grid-150", observation="report_c", reward="report_c"), after=STAY)
    # A decision that stands costs 20 / 2400 for time and 0.1.
    batch.step(np.array(STAND, np.float32))
    assert batch.rewards[0, 0] == pytest.approx(-20.0 / 2400.0 - 0.1)
    parker, body = batch.world.parking.parkers[0, 0], batch.world.bodies[0, 0]
    body.x, body.y, body.heading = parker.x, parker.y + 5.0 * np.sin(parker.heading), parker.heading
    body.trailers["heading"] = parker.heading
    batch.step(np.array(STAND, np.float32))
    terms = dict(zip(batch.terms, batch.buffers.terms[0, 0].tolist(), strict=True))
    assert (terms["parked"], terms["aligned"]) == (1.0, 1.0)
    assert batch.episode_of(0, 0)["aligned"]


def test_with_a_trailer_every_reward_is_that_of_its_goals_and_both_headings_count() -> None:
    env = gymnasium.make(registration.PARK_TRAILER_GOAL).unwrapped
    seen, _ = env.reset(seed=4)
    assert seen["achieved_goal"].shape == (7,)
    for action in (AHEAD, BACK, BACK):
        seen, reward, *_, info = env.step(np.array(action, np.float32))
        again = env.compute_reward(seen["achieved_goal"], seen["desired_goal"], info)
        assert reward == again
    there = seen["desired_goal"].astype(np.float64)
    assert env.compute_reward(there, there, {}) == 0.0
    bent = there.copy()
    bent[4:6] = there[4] * np.cos(0.2) - there[5] * np.sin(0.2), there[5] * np.cos(0.2)
    assert env.compute_reward(bent, there, {}) == -1.0


def test_with_goals_a_jack_knife_costs_as_much_as_a_crash() -> None:
    env = gymnasium.make(registration.PARK_TRAILER_GOAL).unwrapped
    env.reset(seed=3)
    is_over = False
    while not is_over:
        _, reward, is_over, is_cut, info = env.step(np.array([-1.0, 1.0], np.float32))
        assert not is_cut
    assert info["reward_terms"]["jack_knife"] == 1.0
    assert (info["crashed"], reward) == (True, -1.0 + CRASH)


def test_goals_of_a_level_that_judges_the_trailer_are_refused() -> None:
    with pytest.raises(ScenarioError, match="judges its last trailer; choose another"):
        gymnasium.make(registration.PARK_TRAILER_GOAL, level="dock")


def test_lorries_share_a_lot_and_a_vector_holds_one_in_each() -> None:
    lot = parallel_lot("grid-150", vehicles=3, observation="park_trailer")
    seen, _ = lot.reset(seed=2)
    assert len(seen) == 3
    lot.step({agent: np.array(AHEAD, np.float32) for agent in lot.agents})
    lot.close()
    vector = gymnasium.make_vec(registration.PARK_TRAILER, num_envs=4)
    first, _ = vector.reset(seed=1)
    assert first.shape[0] == 4
    vector.close()


# A team


def pair(**options: object) -> Batch:
    """Return two cars for 2 s, the first with its back to a wall; a metre gained is worth 1."""
    reward = {"goal_progress": 1.0, "crash": -10.0}
    task = parking_task("gate", vehicles=2, limit_s=2.0, reward=reward, **options)
    batch = Batch(task, after=STAY)
    batch.world.bodies["x"][0, 0], batch.world.bodies["heading"][0, 0] = 3.4, 0.0
    return batch


def test_a_team_gets_the_mean_until_its_last_vehicle_is_done() -> None:
    """One backs into the wall behind it, the other one drives on until the time is up."""
    own, team = pair(), pair(team=True)
    total, ends = np.zeros(2), []
    for step in range(30):
        actions = np.array([[BACK, AHEAD]], np.float32)
        own.step(actions)
        team.step(actions)
        assert team.rewards[0] == pytest.approx(np.full(2, own.rewards[0].mean()), abs=1e-6)
        total += team.rewards[0]
        ends += [step + 1] * int((own.terminated[0] | own.truncated[0]).sum())
        if own.buffers.idle.all():
            break
        assert not (team.terminated | team.truncated).any()
    # One had left, and was paid on for the rest of the 2 s.
    assert ends[0] < ends[1] == 20
    assert team.truncated[0].tolist() == [1, 1]  # time has cut the round off
    for k, ending in enumerate(("wall", "late")):
        episode = team.episode_of(0, k)
        assert (episode["ending"], episode["l"]) == (ending, 20)
        assert episode["r"] == pytest.approx(total[k], abs=1e-4)
    team.step(np.zeros((1, 2, 2), np.float32))
    assert not team.rewards.any()
    assert not (team.terminated | team.truncated).any()


def test_a_team_keeps_to_pettingzoo() -> None:
    lot = parallel_lot("gate", vehicles=2, limit_s=1.0, team=True)
    parallel_api_test(lot, num_cycles=30)
    lot.reset(seed=1)
    while lot.agents:
        before = lot.agents
        _, rewards, *_ = lot.step(dict.fromkeys(lot.agents, np.float32(BACK)))
        assert len(set(rewards.values())) == 1
    assert before == ["kart_0", "kart_1"]  # they leave together


def test_a_round_of_several_begins_again_once_all_are_done() -> None:
    batch = Batch(parking_task("gate", vehicles=2, limit_s=1.0), after=REENTER)
    for _ in range(20):  # a round takes 10 decisions
        batch.step(np.array([[STAND, STAND]], np.float32))
        assert not batch.buffers.idle.any()  # both are late in the same decision
    assert batch.buffers.rounds["number"][0] == 3
