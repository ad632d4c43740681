"""What actions do, what is rewarded, and what a reality gap changes."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from race_server.core import codes
from race_server.core.vehicle_presets import LORRY
from race_server.core.vehicles import GRAVITY, vehicle_record
from race_server.envs.actions import CRAWLED, MEMORY, PACED, Driven, discrete_table, read_action
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.presets import parking_task, time_trial_task
from race_server.envs.racing.reward_terms import REWARDS, TERMS, reward_weights
from race_server.envs.reality_gap import RealityGap
from race_server.errors import ScenarioError
from race_server.scenario.sensors import Lidar
from support.tasks import ring_task


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


def test_delays_are_the_whole_decisions_within_their_range() -> None:
    gap = RealityGap(action_delay=(0.4, 1.6), actuator_lag=(0.4, 1.6))
    assert gap.ranges()[:3].tolist() == [[1.0, 1.0], [0.0, 0.0], [0.4, 1.6]]
    batch = Batch(ring_task(1, gap=RealityGap(action_delay=(0, 1.5))), worlds=50)
    assert {batch.draws(w, 0)["action_delay"] for w in range(50)} == {0.0, 1.0}


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


def test_a_pedal_is_as_late_backwards_as_it_is_ahead() -> None:
    gap = RealityGap(actuator_lag=(0.5, 0.5))
    task = parking_task("zone-30", action="park", gap=gap, vehicle="kart-13")
    late = 1.0 - np.exp(-0.1 / 0.5)  # a decision of 0.1 s
    pedals = []
    for pedal in (1.0, -1.0):
        batch = Batch(task)
        batch.step([[[pedal, 0.0]]])
        pedals.append(float(batch.buffers.controls[0, 0, 1]))
    assert pedals == pytest.approx([late, -late])


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


def test_a_hitch_is_as_far_behind_the_axle_as_the_gap_says() -> None:
    task = parking_task("dock-35", action="dock")
    batch = Batch(replace(task, gap=RealityGap(hitch=(1.1, 1.1))))
    (nominal,) = batch.task.scenarios[0].vehicle_of(0).trailers
    assert batch.world.vehicles[0, 0].trailers[0].hitch == pytest.approx(1.1 * nominal.hitch)
    batch.reset()
    assert batch.world.vehicles[0, 0].trailers[0].hitch == pytest.approx(1.1 * nominal.hitch)


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
        ({"gap": RealityGap(mass=1.2)}, "reality gap mass = 1.2: give two numbers"),  # type: ignore[arg-type]
        ({"gap": RealityGap(mass=(1.0, 1.1, 1.2))}, r"mass = \(1.0, 1.1, 1.2\): give two"),  # type: ignore[arg-type]
        ({"gap": RealityGap(grip=("a", 1.0))}, r"grip = \('a', 1.0\): give two numbers"),  # type: ignore[arg-type]
        ({"gap": RealityGap(action_delay=(0.2, 0.8))}, "from 0.2 to 0.8: no whole number"),
    ],
)
def test_a_task_that_makes_no_race_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        Batch(ring_task(**options))


def test_every_reward_table_weighs_known_terms() -> None:
    for name in REWARDS:
        assert len(reward_weights(name)) == len(TERMS)
        assert reward_weights(name).any()


def paced(share: float, speed: float, kind: int = PACED) -> list[float]:
    """Return steering, throttle, brake and buttons of a lorry that is told a share of its speed."""
    control, lorry = np.zeros(4), vehicle_record(LORRY)[0]
    action = np.array([share, 0.25], np.float32)
    told = Driven(speed, 0, 0)
    read_action(kind, action, discrete_table(), told, lorry, np.zeros(MEMORY + 1), control)
    return [float(number) for number in control]


def test_who_drives_as_fast_as_told_only_overcomes_the_rolling_resistance() -> None:
    rolling = LORRY.mass * LORRY.rolling * GRAVITY / LORRY.motor_force
    assert paced(0.5, 0.5 * LORRY.top_speed) == pytest.approx([0.25, rolling, 0.0, 0.0])
    assert paced(-1.0, -LORRY.reverse_speed) == pytest.approx([0.25, -rolling, 0.0, 0.0])


def test_who_is_told_to_turn_round_brakes_first() -> None:
    assert paced(-1.0, 1.0)[1:3] == pytest.approx([0.0, 1.0])
    assert paced(1.0, -1.0)[1:3] == pytest.approx([0.0, 1.0])
    assert paced(-1.0, 0.05)[1:3] == pytest.approx([-1.0, 0.0])


def test_who_is_told_a_speed_never_comes_to_rest() -> None:
    slowly = paced(0.0, 0.0)
    assert slowly[1] > 0.0
    assert slowly == paced(0.01, 0.0)
    assert paced(-1e-6, 0.0)[1] == pytest.approx(-slowly[1])


def test_who_crawls_drives_at_the_square_of_what_it_is_told() -> None:
    rolling = LORRY.mass * LORRY.rolling * GRAVITY / LORRY.motor_force
    crawled = paced(0.5, 0.25 * LORRY.top_speed, CRAWLED)
    assert crawled == pytest.approx([0.25, rolling, 0.0, 0.0])
    assert paced(-1.0, -LORRY.reverse_speed, CRAWLED) == pytest.approx([0.25, -rolling, 0.0, 0.0])


def test_who_crawls_stands_where_it_is_told_less_than_a_tenth_of_a_metre_a_second() -> None:
    least = math.sqrt(0.1 / LORRY.top_speed)
    for share in (0.0, 0.99 * least, -0.99 * least):
        assert paced(share, 0.3, CRAWLED) == [0.25, 0.0, 1.0, 0.0]
    assert paced(1.01 * least, 0.0, CRAWLED)[1] > 0.0
