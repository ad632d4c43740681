"""The way out of a jam as a wrapper, and names with an argument."""

import numpy as np
import pytest

from race_server.core.driver import driver_named
from race_server.core.messages import Control
from race_server.core.observation import Observation, layout_of
from race_server.errors import DriverError
from support.briefings import briefing

RAYS = 21
LAYOUT = layout_of("lidar", RAYS)


def test_what_stands_behind_a_colon_is_handed_to_the_driver() -> None:
    assert driver_named("unstuck:follow_gap").preset == "lidar"


def test_an_unknown_driver_inside_is_named() -> None:
    with pytest.raises(DriverError, match="'schumacher' is unknown; installed drivers are"):
        driver_named("unstuck:schumacher")


def test_a_driver_that_needs_an_argument_says_how_it_is_written() -> None:
    with pytest.raises(DriverError, match="'unstuck' needs an argument; write unstuck:ARGUMENT"):
        driver_named("unstuck")


def test_a_driver_that_takes_no_argument_says_so() -> None:
    with pytest.raises(DriverError, match="'avoider' takes no argument; leave out ':fast'"):
        driver_named("avoider:fast")


def test_a_driver_without_a_lidar_cannot_be_wrapped() -> None:
    with pytest.raises(DriverError, match="'pure_pursuit' sees 'track', which has no lidar"):
        driver_named("unstuck:pure_pursuit")


def answers(ranges: np.ndarray, speed: float, times: int = 1, **more: float) -> list[Control]:
    driver = driver_named("unstuck:avoider")
    driver.reset(briefing("lidar", lidar_field=np.pi))
    values = np.zeros(LAYOUT.size, np.float32)
    values[LAYOUT.slices["lidar"]] = ranges
    values[LAYOUT.slices["speed"]] = speed
    for name, value in more.items():
        values[LAYOUT.slices[name]] = value
    return [driver.act(Observation(tick, LAYOUT, values)) for tick in range(times)]


def blocked(first: int, last: int) -> np.ndarray:
    """Return a free scan, right to left, with something just before the nose at some rays."""
    ranges = np.full(RAYS, 3.0)
    ranges[first:last] = 0.2
    return ranges


def test_something_on_the_left_of_the_nose_turns_the_nose_to_the_right() -> None:
    # Backwards the nose goes away from the side that the wheels are turned to.
    (control,) = answers(blocked(11, 13), 0.0)
    assert (control.steering, control.throttle) == (1.0, -1.0)


def test_something_on_the_right_of_the_nose_turns_it_to_the_left() -> None:
    (control,) = answers(blocked(8, 10), 0.0)
    assert (control.steering, control.throttle) == (-1.0, -1.0)


def test_it_reverses_for_a_second_at_a_time() -> None:
    # 20 decisions, after which the wall is as near as before and it reverses again.
    assert all(control.throttle == -1.0 for control in answers(blocked(8, 10), 0.0, 25))


def test_a_fast_car_that_passes_something_closely_races_on() -> None:
    (control,) = answers(blocked(8, 10), 2.0)
    assert control.throttle >= 0.0


def test_on_a_free_way_the_car_never_stalls() -> None:
    (control,) = answers(np.full(RAYS, 3.0), 0.0, speed_cap=8.0)
    assert control.throttle >= 0.3
    assert control.brake == 0.0


def test_drop_outs_are_nothing_near() -> None:
    ranges = np.full(RAYS, 3.0)
    ranges[10] = 0.0
    (control,) = answers(ranges, 0.0)
    assert control.throttle >= 0.0


def test_before_the_lights_go_out_it_stands() -> None:
    (control,) = answers(blocked(8, 10), 0.0, lights=1.0)
    assert (control.throttle, control.brake) == (0.0, 1.0)
