"""The lap of a driver's best pieces: what fits, what a change costs, and what is left as it was."""

from dataclasses import replace

import numpy as np
import pytest

from race_server.coaching.corners import Corner, corners_of
from race_server.coaching.lap import Lap, reference_lap
from race_server.coaching.pieces import best_pieces
from race_server.core.vehicle_presets import KART_60
from race_server.scenario.raceline.attach import reference_line
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.track.load import load_course

BOUNDS = bounds_of(KART_60)


@pytest.fixture(scope="module")
def limit() -> Lap:
    course = load_course("hangar-400")
    return reference_lap(course, reference_line(course, KART_60), BOUNDS)


def slower(lap: Lap, corner: Corner, by: float, name: str = "") -> Lap:
    """Return a lap that loses this share of its speed around an apex, and nothing elsewhere."""
    reach = 0.4 * (corner.end - corner.begin)
    near = np.clip(1.0 - np.abs(lap.progress - corner.apex) / reach, 0.0, 1.0)
    speed = lap.speed * (1.0 - by * near)
    steps = np.diff(lap.time) * 0.5 * (lap.speed[1:] + lap.speed[:-1])
    time = np.append(0.0, np.cumsum(2.0 * steps / (speed[1:] + speed[:-1])))
    return replace(lap, name=name, speed=speed, time=time, time_us=round(1e6 * float(time[-1])))


def test_two_laps_with_a_slow_corner_each_make_one_without(limit: Lap) -> None:
    corners = corners_of(limit)
    laps = [slower(limit, corners[1], 0.1), slower(limit, corners[3], 0.1)]
    assert min(lap.time_us for lap in laps) > limit.time_us + 50_000
    found = best_pieces(laps, corners, BOUNDS)
    # The second lap to somewhere between the two corners, and the first one from there on.
    assert [piece.lap for piece in found.pieces] == [1, 0]
    assert corners[1].apex < found.pieces[0].end < corners[3].apex
    assert found.pieces[0].end == found.pieces[1].begin
    assert (found.pieces[0].begin, found.pieces[1].end) == (0.0, limit.progress[-1])
    assert found.time_us == pytest.approx(limit.time_us, abs=2_000)


def test_one_lap_is_its_best_pieces(limit: Lap) -> None:
    found = best_pieces([limit], corners_of(limit), BOUNDS)
    assert [piece.lap for piece in found.pieces] == [0]
    assert found.time_us == pytest.approx(limit.time_us, abs=1)


def test_a_change_that_gains_less_than_ten_milliseconds_is_none(limit: Lap) -> None:
    corners = corners_of(limit)
    laps = [slower(limit, corners[1], 0.002), slower(limit, corners[3], 0.002)]
    assert 1_000 < laps[0].time_us - limit.time_us < 10_000
    assert len(best_pieces(laps, corners, BOUNDS).pieces) == 1


def test_laps_that_pass_all_places_apart_are_not_joined(limit: Lap) -> None:
    corners = corners_of(limit)
    laps = [slower(limit, corners[1], 0.1), slower(limit, corners[3], 0.1)]
    laps[1] = replace(laps[1], offset=laps[1].offset + 0.5)
    found = best_pieces(laps, corners, BOUNDS)
    assert len(found.pieces) == 1
    assert found.time_us == min(lap.time_us for lap in laps)


@pytest.mark.parametrize("seed", range(8))
def test_pieces_are_never_slower_than_the_best_lap_nor_faster_than_the_limit(
    limit: Lap, seed: int
) -> None:
    chance, corners = np.random.default_rng(seed), corners_of(limit)
    laps = []
    for _ in range(5):
        lap = limit
        for corner in corners:
            lap = slower(lap, corner, float(chance.uniform(0.0, 0.12)))
        laps.append(replace(lap, offset=lap.offset + float(chance.uniform(-0.2, 0.2))))
    found = best_pieces(laps, corners, BOUNDS)
    assert limit.time_us <= found.time_us <= min(lap.time_us for lap in laps)
    assert len(found.pieces) > 1
