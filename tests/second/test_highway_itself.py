"""An environment of highway-env as it is, behind a world of ours; and its vehicles as traffic."""

from typing import Any

import numpy as np
import pytest

from race_server.competition.lap_exam import CourseTry, LapExamSpec
from race_server.competition.time_trial.run_spec import RunSpec, scenario_of
from race_server.competition.transfer_traffic import drive_in_traffic, traffic_rows
from race_server.core import codes
from race_server.core.messages import Retirement
from race_server.core.vehicle_presets import TT02
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.presets import task_on
from race_server.errors import ScenarioError
from race_server.scenario.highway import has_highway
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.load import load_course
from race_server.second.simulator import simulator_named
from support.courses import ring

# Its kernels take a minute to compile, and no other test calls them.
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not has_highway(), reason="highway-env is not installed"),
]

ROAD = "highway:racetrack-v0:tenth"
RULES = Rules(laps=0, items=False, countdown_s=0.0, limit_s=60.0)


def road(options: str = "", *, karts: int = 2, ticks: int = 4) -> Batch:
    """Return a model car on the road, with others; 0.2 s there are 4 ticks."""
    scenario = Scenario(load_course(ROAD), karts=karts, vehicles=(TT02,), rules=RULES)
    task = task_on(
        (scenario,),
        learners=1,
        opponents=("pure_pursuit",) if karts > 1 else (),
        observation=("speed",),
        action="control",
        decision_ticks=ticks,
        simulator=f"highway-env-itself{options}",
    )
    return Batch(task, seed=1, after=STAY)


def there(batch: Batch) -> Any:
    simulator: Any = batch._simulator
    return simulator.env


def steer(batch: Batch, steering: float, throttle: float = 0.0) -> Any:
    batch.step(np.array([steering, throttle, 0.0, 0.0], np.float32))
    return batch.world.bodies[0]


def test_karts_are_where_its_vehicles_are_a_tenth_as_far() -> None:
    batch = road()
    bodies = steer(batch, 0.0)
    env = there(batch)
    ours = np.stack([bodies["x"], bodies["y"]], axis=1)
    assert ours[0] == pytest.approx(env.vehicle.position / 10.0)
    assert ours[1] == pytest.approx(env.road.vehicles[1].position / 10.0)
    # 10 m/s there, over the root of ten.
    assert bodies["speed"][0] == pytest.approx(10.0 / np.sqrt(10.0))


def test_without_pedals_it_is_only_steered_and_with_pedals_driven() -> None:
    assert steer(road(), 0.0, 1.0)["speed"][0] == pytest.approx(3.162, abs=1e-3)
    # 3.38 N push 2.331 kg for 0.2 s there: 0.29 m/s there more than 10.
    faster = steer(road(":pedals"), 0.0, 1.0)["speed"][0]
    assert faster == pytest.approx((10.0 + 0.2 * 3.38 / 2.331) / np.sqrt(10.0), abs=0.01)


def test_its_end_of_an_episode_is_the_end_of_the_race() -> None:
    batch = road()
    decisions = 0
    while batch.world.bodies[0, 0].status == codes.RACING and decisions < 60:
        steer(batch, 1.0)
        decisions += 1
    assert there(batch).vehicle.crashed or not there(batch).vehicle.on_road
    assert batch.world.racers[0, 0].retired_for == Retirement.CRASH
    assert 1 < decisions < 60


def test_beside_its_lanes_it_goes_on_where_only_a_crash_ends_it() -> None:
    batch = road(":crash-only", karts=1)
    for _ in range(6):
        steer(batch, 1.0)
    assert not there(batch).vehicle.on_road
    assert batch.world.bodies[0, 0].status == codes.RACING


def test_a_kart_for_which_it_has_no_vehicle_is_absent() -> None:
    batch = road(karts=8)
    here = steer(batch, 0.0)["status"] != codes.ABSENT
    assert 2 <= here.sum() == len(there(batch).road.vehicles)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("highway-env-itself:brakes", "knows no option 'brakes'; choose pedals, crash-only"),
        ("highway-env-itself", "has highway:racetrack-v0 and the like alone"),
    ],
)
def test_what_it_does_not_have_is_named(name: str, message: str) -> None:
    scenario = Scenario(ring(radius=6.0, half_width=1.0), karts=1, vehicles=(TT02,), rules=RULES)
    with pytest.raises(ScenarioError) as caught:
        simulator_named(name, (scenario,))
    assert message in str(caught.value)


def test_it_decides_in_its_own_time_and_a_driver_in_another() -> None:
    batch = road(ticks=3)
    bodies, env = batch.world.bodies[0], None
    for _ in range(4):
        steer(batch, 0.0)
    env = there(batch)
    # 12 ticks are four decisions of the driver, and three of 0.2 s there.
    assert env.time == pytest.approx(0.6)
    assert [bodies["x"][0], bodies["y"][0]] == pytest.approx(env.vehicle.position / 10.0)


def test_the_driver_of_a_run_in_traffic_starts_behind_the_others() -> None:
    course = load_course("oval")
    scenario = scenario_of(RunSpec("raceline", "oval", traffic=2), course)
    assert scenario.karts == 3
    assert scenario.course.grid[0].tolist() == course.grid[2].tolist()
    with pytest.raises(ScenarioError, match="traffic 99: the grid of oval has"):
        scenario_of(RunSpec("raceline", "oval", traffic=99), course)


def test_a_row_in_traffic_has_both_places() -> None:
    one = CourseTry("ann", "ring", 2, 5.0, (5.5, 6.0), clean=1, contacts=3, rescues=0, overtakes=4)
    assert traffic_rows([("here", one)], 2) == []
    (row,) = traffic_rows([("here", one), ("there", one)], 2)
    assert (row.there["clean_laps"], row.there["overtakes"], row.traffic) == (1, 4, 2)


def test_its_own_environments_have_their_own_tracks_alone() -> None:
    spec = LapExamSpec(("oval",))
    with pytest.raises(ScenarioError, match="highway-env-itself has highway:racetrack-v0"):
        list(drive_in_traffic(spec, ["raceline"], {}, "highway-env-itself"))
