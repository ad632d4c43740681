"""Roads of highway-env as courses of ours, and courses of ours as roads of highway-env."""

import math

import numpy as np
import pytest

from race_server.errors import TrackError
from race_server.scenario.highway import has_highway
from race_server.scenario.track.highway_roads import TRACKS, highway_file, loop_of
from race_server.scenario.track.load import load_course

pytestmark = pytest.mark.skipif(not has_highway(), reason="highway-env is not installed")

# Middle of an arc of each track, and its radius [m] in the middle of all lanes, by its own figures:
# lanes of 20 and 25 m around (100, -20); of 20 to 30 m around it; of 20 to 30 m around (200, -20).
BENDS = {
    "racetrack-v0": ((100.0, -20.0), 22.5),
    "racetrack-oval-v0": ((100.0, -20.0), 25.0),
    "racetrack-large-v0": ((200.0, -20.0), 25.0),
}
WIDTHS = {"racetrack-v0": 10.0, "racetrack-oval-v0": 15.0, "racetrack-large-v0": 15.0}


@pytest.mark.parametrize("track", TRACKS)
def test_width_and_curvature_are_those_of_the_lanes_within_a_hundredth(track: str) -> None:
    course = load_course(f"highway:{track}")
    (x, y), radius = BENDS[track]
    place = np.array([x, y]) + radius * math.sqrt(0.5)  # at 45° of the bend
    index = int(np.argmin(np.hypot(*(course.line[:, :2] - place).T)))
    assert np.hypot(*(course.line[index, :2] - place)) < 0.5
    # Over 6 m: single samples of any course vary by some hundredths.
    bend = course.line[index - 6 : index + 6, 3].mean()
    assert 1.0 / abs(bend) == pytest.approx(radius, rel=0.01)
    assert course.half_widths[index].sum() == pytest.approx(WIDTHS[track], rel=0.01)
    assert course.width_mean == pytest.approx(WIDTHS[track], rel=0.01)


def test_the_oval_is_as_long_as_its_straights_and_arcs() -> None:
    # Straights of 100, 30, 110 and 30 m; quarters of 25, 20, 20 and 25 m radius in the middle.
    length = 100.0 + 30.0 + 110.0 + 30.0 + 0.5 * math.pi * (25.0 + 20.0 + 20.0 + 25.0)
    assert load_course("highway:racetrack-oval-v0").length == pytest.approx(length, rel=0.001)


def test_a_tenth_is_ten_times_shorter_and_for_model_cars() -> None:
    whole, tenth = (load_course(f"highway:racetrack-v0{end}") for end in ("", ":tenth"))
    assert whole.length == pytest.approx(10.0 * tenth.length, rel=0.001)
    assert b'scale = "1/10"' in highway_file("highway:racetrack-v0:tenth")


@pytest.mark.parametrize("name", ["highway:racetrack-v7", "highway:", "highway:CartPole-v1"])
def test_a_name_that_highway_env_does_not_know_is_named(name: str) -> None:
    with pytest.raises(TrackError, match=name.removeprefix("highway:") or "highway:"):
        load_course(name)


def test_roads_that_are_no_loop_are_refused() -> None:
    with pytest.raises(TrackError, match="no single loop"):
        loop_of({"a": {"b": [], "c": []}, "b": {"a": []}}, "fork")
    with pytest.raises(TrackError, match="no single loop"):
        load_course("highway:parking-v0")
