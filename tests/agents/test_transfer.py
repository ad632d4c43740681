"""A policy of ours in a second simulator: what it sees, what it drives, and how it is judged."""

import math
from typing import Any

import numpy as np
import pytest

from race_agents.reproductions.kart_there import KartThere, similar_kart
from race_agents.reproductions.parking_v0 import examine_there, make_parking_v0
from race_agents.reproductions.plan import Learned, ParkingExam, TrainingScale, Variant
from race_agents.reproductions.registry import reproduction_named
from race_agents.reproductions.training import Training, run_training
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import training_task
from race_server.envs.batch import Batch
from race_server.errors import ScenarioError
from race_server.scenario import highway
from race_server.scenario.highway import has_highway
from race_server.second.similarity import Similarity

needs_highway = pytest.mark.skipif(not has_highway(), reason="highway-env is not installed")

# The turning circle of kart-13 at full lock is 1.77 m, that of parking-v0's car 5 m.
KART = Similarity(2.5, 2.0)


def settings(*changes: str) -> Settings:
    return read_settings("parking-1", ["steps=10", *changes])


def kart_at(x: float, y: float, degrees: float, speed: float = 0.0) -> KartThere:
    """Return a kart in parking-v0, whose slot is at (10, 14) and points to the north."""
    kart = KartThere(settings(), KART)
    kart.reset(seed=1)
    place(kart.env, x, y, degrees, speed)
    return kart


def place(env: Any, x: float, y: float, degrees: float, speed: float = 0.0) -> None:
    car = env.unwrapped.vehicle
    car.position, car.heading, car.speed = np.array([x, y]), math.radians(degrees), speed
    car.goal.position, car.goal.heading = np.array([10.0, 14.0]), math.radians(90.0)


def test_a_similar_kart_turns_as_narrowly_and_decides_as_often() -> None:
    similar = similar_kart(settings())
    assert similar.length == pytest.approx(5.0 / (1.087 / math.tan(0.55)))
    assert similar.time == pytest.approx(2.0)  # 0.2 s there, 0.1 s here


@needs_highway
def test_it_sees_what_a_kart_in_the_same_place_sees() -> None:
    kart = kart_at(0.0, -5.0, 30.0)
    batch = Batch(training_task(settings()), worlds=1)
    body, parker = batch.world.bodies[0, 0], batch.world.parking.parkers[0, 0]
    offset = batch.world.vehicles[0, 0].box_offset
    # 2.5 m there are one: the middle of the body at (0, -2), the slot at (4, 5.6).
    body.heading, body.speed = math.radians(30.0), 0.0
    body.x, body.y = -offset * math.cos(body.heading), -2.0 - offset * math.sin(body.heading)
    parker.x, parker.y, parker.heading = 4.0, 5.6, math.radians(90.0)
    batch.step(np.zeros((1, 1, 2)))
    assert kart.seen() == pytest.approx(batch.observations[0, 0], abs=1e-4)


@needs_highway
def test_pedal_and_wheel_are_those_of_a_kart_within_what_the_car_can() -> None:
    kart = kart_at(0.0, 0.0, 0.0)
    # 1200 N on 261 kg are 4.6 m/s2, there 2.5 / 4 of it, of 5 m/s2.
    pedal, wheel = kart.controls([1.0, 1.0])
    assert pedal == pytest.approx(1200.0 / 261.0 * 2.5 / 4.0 / 5.0)
    # 2.5 rad/s for 0.1 s: 0.25 rad of 0.55, as narrow a bend beside the length.
    assert wheel == pytest.approx(math.atan(math.tan(0.25) / math.tan(0.55)) / math.radians(45.0))
    for _ in range(2):
        _, wheel = kart.controls([0.0, 1.0])
    assert wheel == pytest.approx(1.0)


@needs_highway
def test_a_kart_brakes_to_a_stand_before_it_goes_backwards() -> None:
    # 0.25 m/s there are 0.2 m/s, and gone within 0.1 s.
    kart = kart_at(0.0, 0.0, 0.0, speed=0.25)
    kart.step([-1.0, 0.0])
    assert kart.values()["speed"] == pytest.approx(0.0, abs=1e-6)
    kart.step([-1.0, 0.0])
    assert kart.values()["speed"] < -0.3


@needs_highway
def test_metres_towards_the_slot_are_worth_what_they_are_at_home() -> None:
    kart = kart_at(10.0, 4.0, 90.0, speed=2.5)
    kart._before = kart.values()
    _, reward, is_over, _, info = kart.step([0.0, 0.0])
    # 0.5 m there, 0.2 m to the policy, for a 300th of the time.
    assert reward == pytest.approx(0.03 * 0.2 - 1.0 / 300.0, abs=1e-6)
    assert (is_over, info["is_success"]) == (False, False)


@needs_highway
def test_an_exam_counts_by_their_criterion_and_by_ours() -> None:
    env = make_parking_v0()
    ways = iter((1.5, 0.2, 3.0))  # metres short of the slot's middle, where the car stands

    def act(_: Any) -> Any:
        place(env, 10.0, 14.0 - offset[0], 90.0)
        return np.zeros(2, np.float32)

    offset = [0.0]

    def begin() -> None:
        offset[0] = next(ways)

    found = examine_there(env, begin, act, 3)
    # 4.8 m along is enough for theirs, 0.5 m for the level goal, 0.3 m for the level parked.
    assert {name: found[name] for name in ("own", "goal", "parked", "crash")} == {
        "own": 3,
        "goal": 1,
        "parked": 1,
        "crash": 0,
    }
    assert (found["starts"], found["time_s"]) == (3, pytest.approx(0.2))


@needs_highway
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("observation=park", "observes radar"),
        ("reward={standing = 1.0}", "rewards standing"),
        ("action=report_a", "'report_a': `parking-v0` takes park"),
    ],
)
def test_what_the_second_simulator_lacks_is_named(change: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        KartThere(settings(change), KART)


def test_without_highway_env_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(highway, "has_highway", lambda: False)
    with pytest.raises(ScenarioError, match=r"race-server\[bench\]"):
        make_parking_v0()


class Given:
    """A lesson that learns nothing."""

    def __repr__(self) -> str:
        return "Given()"

    def give(self, asked: Settings, starts: int, tell: Any) -> Learned:
        tell(1.0)
        return Learned(7, {"starts": starts, "own": asked.seed}, [(7, 0.5)])


def test_a_row_with_a_lesson_is_what_the_lesson_gives() -> None:
    given = Training(Variant("given", lesson=Given()), 3, settings("seed=3"), ParkingExam(5))
    found = run_training(given)
    assert (found["steps"], found["curve"]) == (7, [(7, 0.5)])
    assert found["figures"] == {"starts": 5, "own": 3}
    plain = Training(Variant("given"), 3, settings("seed=3"), ParkingExam(5))
    assert found["key"] != plain.key


def test_every_row_of_the_transfer_has_a_lesson() -> None:
    plan = reproduction_named("report-a-transfer")
    assert all(row.lesson is not None for row in plan.rows)
    assert isinstance(plan.full, TrainingScale)
    assert plan.full.steps == 30_000
