"""Worlds of ours whose karts are moved by highway-env."""

import math
from typing import Any

import numpy as np
import pytest

from race_server.competition.time_trial.run import drive_run
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.vehicle_presets import KART_30, TT02
from race_server.envs.batch import Batch
from race_server.envs.presets import parking_task, task_on
from race_server.errors import ScenarioError
from race_server.scenario.highway import has_highway
from race_server.scenario.race import Rules, Scenario
from race_server.second.highway_network import network_for
from race_server.second.highway_options import HighwayOptions
from race_server.second.similarity import Similarity
from support.courses import ring

# Its kernels take a minute to compile, and no other test calls them.
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not has_highway(), reason="highway-env is not installed"),
]

RULES = Rules(laps=0, items=False, countdown_s=0.0, limit_s=60.0)
THERE = "highway-env"


def world_of(vehicle: Any = TT02, *, simulator: str = THERE, radius: float = 6.0) -> Batch:
    """Return one car on a wide ring; it obeys `control` actions, 20 a second."""
    scale = vehicle.length / TT02.length
    course = ring(radius=scale * radius, half_width=scale * 2.0)
    scenario = Scenario(course, karts=1, vehicles=(vehicle,), rules=RULES)
    task = task_on((scenario,), observation=("speed",), action="control", simulator=simulator)
    return Batch(task, seed=1)


def drive(batch: Batch, steering: float, throttle: float, brake: float, decisions: int) -> Any:
    for _ in range(decisions):
        batch.step(np.array([steering, throttle, brake, 0.0], np.float32))
    return batch.world.bodies[0, 0]


def test_a_pedal_gives_its_acceleration_at_once_and_in_each_step() -> None:
    # 3.38 N push 2.331 kg: 1.45 m/s²; 3 ticks are 0.05 s.
    body = drive(world_of(), 0.0, 1.0, 0.0, 10)
    assert body.speed == pytest.approx(10 * 0.05 * 3.38 / 2.331, rel=1e-6)


def test_a_car_goes_round_the_circle_of_its_wheels_without_slip() -> None:
    batch = world_of()
    body = drive(batch, 0.0, 1.0, 0.0, 14)
    body = drive(batch, 0.5, 0.0, 0.0, 1)
    # The middle between axles 0.257 m apart moves at atan(tan(0.157) / 2) to the body.
    slip = math.atan(0.5 * math.tan(0.157))
    radius = 0.1285 / math.sin(slip)
    assert math.hypot(body.speed, body.lateral_speed) / body.yaw_rate == pytest.approx(radius)
    assert body.steering == pytest.approx(0.157)


def test_brakes_stop_a_car_and_do_not_drive_it_back() -> None:
    batch = world_of()
    drive(batch, 0.0, 1.0, 0.0, 10)
    # 9.3 N of brakes are 4 m/s²: from 0.725 m/s it stands after 0.18 s.
    assert drive(batch, 0.0, 0.0, 1.0, 4).speed == pytest.approx(0.0, abs=1e-9)


def test_acceleration_and_steering_end_at_those_of_its_action() -> None:
    strong = TT02.__class__(**{**vars(TT02), "name": "strong", "motor_force": 100.0})
    assert drive(world_of(strong), 0.0, 1.0, 0.0, 1).speed == pytest.approx(0.05 * 5.0)


def test_a_top_speed_is_kept() -> None:
    batch = world_of(KART_30, radius=60.0)
    batch.world.bodies[0, 0].speed = 8.0
    body = drive(batch, 0.0, 1.0, 0.0, 12)
    assert body.speed == pytest.approx(30.0 / 3.6, rel=1e-6)


def test_actuators_of_ours_turn_the_wheels_at_their_rate() -> None:
    batch = world_of(simulator="highway-env:steps=ours,actuators=ours")
    assert drive(batch, 1.0, 0.0, 0.0, 1).steering == pytest.approx(3.2 * 0.05)


def test_tyres_of_ours_slip_under_actuators_of_theirs() -> None:
    batch = world_of(simulator="highway-env:tyres=ours,steps=ours")
    body = drive(batch, 0.0, 1.0, 0.0, 14)
    body = drive(batch, 1.0, 0.0, 0.0, 1)
    assert body.steering == pytest.approx(0.314, abs=0.02)  # the whole way within a decision
    # Wheels that never slip would turn it at once: 0.9 m/s on a circle of 0.8 m are 1.1 rad/s.
    assert 0.1 < body.yaw_rate < 2.0


def test_a_wall_holds_a_car_that_was_moved_there_as_one_of_ours() -> None:
    batch = world_of(radius=4.0)
    body = drive(batch, 0.0, 1.0, 0.0, 80)
    assert batch.world.racers[0, 0].wall_contacts > 0
    assert math.hypot(body.x, body.y) < 4.0 + 2.0  # the border is at a radius of 6 m


def test_the_same_seed_moves_the_same_way() -> None:
    first, second = (world_of() for _ in range(2))
    for batch in (first, second):
        drive(batch, 0.3, 1.0, 0.0, 30)
    assert first.digest() == second.digest()


def test_model_cars_are_ten_times_larger_there_at_equal_accelerations() -> None:
    similar = Similarity.of([TT02])
    assert similar.length == 10.0
    assert similar.length / similar.time**2 == pytest.approx(1.0)
    assert Similarity.of([KART_30]) == Similarity(1.0, 1.0)
    with pytest.raises(ScenarioError, match="model cars and karts"):
        Similarity.of([TT02, KART_30])


def test_a_course_of_ours_is_one_road_around() -> None:
    course = ring(radius=6.0, half_width=1.0)
    network = network_for(course, 10.0)
    lanes = [lane for ends in network.graph.values() for lanes in ends.values() for lane in lanes]
    assert sum(lane.length for lane in lanes) == pytest.approx(2.0 * math.pi * 60.0, rel=0.01)
    for angle in np.arange(0.1, 6.2, 0.4):
        place = np.array([60.0 * math.cos(angle), 60.0 * math.sin(angle)])
        lane = network.get_lane(network.get_closest_lane_index(place))
        along, aside = lane.local_coordinates(place)
        assert abs(aside) < 0.3
        assert lane.width_at(along) == pytest.approx(20.0, rel=0.02)


def test_a_driver_laps_the_ring_there_and_its_laps_count() -> None:
    run = drive_run(RunSpec("raceline", "oval", laps=1, simulator=THERE))
    assert run.remark == ""
    assert run.laps[0].is_clean


def test_the_vehicle_of_highway_env_drives_in_our_race() -> None:
    run = drive_run(RunSpec("highway_idm", "oval", laps=1))
    assert run.remark == ""
    assert run.laps[0].is_clean


@pytest.mark.parametrize(
    ("simulator", "message"),
    [
        ("carla", "simulator 'carla' is unknown; choose highway-env"),
        ("highway-env:steps=mine", "steps=theirs|ours"),
        ("highway-env:tyres=ours", "has its own steps; add steps=ours"),
        ("highway-env:roads=ours", "no option 'roads=ours'"),
    ],
)
def test_what_is_not_known_of_a_simulator_is_named(simulator: str, message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        world_of(simulator=simulator)
    assert message in str(caught.value)


def test_a_car_parks_there_by_our_rules() -> None:
    task = parking_task("face-to-face", action="control", simulator=THERE)
    batch = Batch(task, seed=1)
    for _ in range(60):
        batch.step(np.array([0.0, 0.3, 0.0, 0.0], np.float32))
        if batch.terminated[0, 0]:
            break
    # The slot is 5 m straight ahead; its level asks for a place, at any speed.
    assert batch.episode_of(0, 0)["ending"] == "parked"


def test_a_trailer_is_refused() -> None:
    with pytest.raises(ScenarioError, match="lorry-16m5 draws a trailer"):
        Batch(parking_task("dock-35", observation="park_trailer", simulator=THERE))


def test_options_are_read_from_words() -> None:
    assert HighwayOptions.of("") == HighwayOptions("theirs", "theirs", "theirs")
    assert HighwayOptions.of("steps=ours") == HighwayOptions(steps="ours")
