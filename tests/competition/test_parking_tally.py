"""Figures of many episodes of parking."""

from typing import Any

import pytest

from race_server.competition.parking_tally import ParkingTally


def episode(ending: str = "parked", *, off_deg: float = 0.0, **figures: float) -> dict[str, Any]:
    """Return an episode as the training world tells it."""
    is_parked = ending == "parked"
    return {
        "is_success": is_parked,
        "aligned": is_parked and off_deg <= 10.0,
        "ending": ending,
        "off_deg": off_deg,
        "time_s": 10.0,
        "path_m": 20.0,
        "direction_changes": 0,
        "walked_into": 0,
        **figures,
    }


def test_three_of_four_parked_are_75_percent_and_the_fourth_is_named() -> None:
    tally = ParkingTally.of([episode(), episode(), episode(off_deg=20.0), episode("late")])
    assert (tally.episodes, tally.success_rate, tally.aligned_rate) == (4, 0.75, 0.5)
    assert tally.aligned_of_parked == pytest.approx(2.0 / 3.0)
    assert tally.failures == {"late": 1}
    low, high = tally.success_interval
    assert 0.3 < low < 0.75 < high < 1.0


def test_a_person_that_is_hit_is_a_collision_and_time_that_runs_out_is_none() -> None:
    endings = ["wall", "block", "vehicle", "person", "person", "late", "left"]
    tally = ParkingTally.of(map(episode, endings))
    assert (tally.collisions, tally.hit_people) == (5, 2)
    assert tally.jack_knives == 0
    assert next(iter(tally.failures)) == "person"


def test_a_hitch_bent_too_far_and_a_trailer_that_touches_its_tractor_are_jack_knives() -> None:
    tally = ParkingTally.of(map(episode, ["jack_knife", "jack_knife", "own_body", "block"]))
    assert (tally.jack_knives, tally.collisions) == (3, 1)


def test_times_ways_and_moves_are_those_of_parked_vehicles() -> None:
    parked = [episode(time_s=t, path_m=2.0 * t, direction_changes=t) for t in (1, 2, 9)]
    tally = ParkingTally.of([*parked, episode("late", time_s=1000.0)])
    assert (tally.time_s_median, tally.path_m_median) == (2.0, 4.0)
    assert tally.direction_changes_mean == 4.0


def test_people_who_walk_into_a_standing_vehicle_are_counted_apart() -> None:
    tally = ParkingTally.of([episode(walked_into=1), episode(walked_into=2)])
    assert (tally.walked_into, tally.hit_people, tally.success_rate) == (3, 0, 1.0)


def test_without_episodes_nothing_is_known() -> None:
    tally = ParkingTally.of([])
    assert tally.success_interval == (0.0, 1.0)
    assert (tally.success_rate, tally.time_s_median, tally.aligned_of_parked) == (0.0, None, None)
