"""The scripted drivers on a small ring."""

import numpy as np
import pytest
from courses import ring
from races import run_race

from agents.scan import repair, widen_edges
from race_server.driver import driver_named, driver_names
from race_server.errors import DriverError
from race_server.messages import EventKind, Status
from race_server.scenario.base import Rules, Scenario

COURSE = ring(radius=6.0, half_width=0.7)


def test_drivers_are_found_by_their_names() -> None:
    assert {"avoider", "follow_gap", "pure_pursuit"} <= set(driver_names())


def test_an_unknown_driver_is_named_with_the_known_ones() -> None:
    with pytest.raises(DriverError, match="'schumacher' is unknown; installed drivers are"):
        driver_named("schumacher")


@pytest.mark.parametrize("name", ["avoider", "follow_gap", "pure_pursuit"])
def test_alone_each_driver_laps_without_touching_a_wall(name: str) -> None:
    scenario = Scenario(COURSE, karts=1, rules=Rules(laps=2, items=False, limit_s=120.0))
    session, _ = run_race(scenario, [name])
    kart = session.world.karts[0, 0]
    assert kart.status == Status.FINISHED
    assert kart.wall_contacts == 0


def test_six_mixed_drivers_race_to_the_end_with_items() -> None:
    names = ["pure_pursuit", "follow_gap", "avoider"] * 2
    scenario = Scenario(COURSE, karts=6, seed=7, rules=Rules(laps=2, limit_s=180.0))
    session, events = run_race(scenario, names)
    assert {row.status for row in session.standings()} == {Status.FINISHED}
    assert EventKind.USE in [event.kind for event in events]


def test_the_same_race_gives_the_same_digest_again() -> None:
    names = ["follow_gap", "pure_pursuit"]
    scenario = Scenario(COURSE, karts=2, seed=3, rules=Rules(laps=1))
    assert run_race(scenario, names)[0].digest() == run_race(scenario, names)[0].digest()


def test_a_drop_out_takes_the_value_between_its_neighbours() -> None:
    assert list(repair(np.array([1.0, 0.0, 3.0], np.float32), 8.0)) == [1.0, 2.0, 3.0]


def test_a_dead_lidar_reads_as_free() -> None:
    assert list(repair(np.zeros(2, np.float32), 8.0)) == [8.0, 8.0]


def test_an_edge_hides_the_space_beside_it() -> None:
    ranges = np.array([1.0, 1.0, 5.0, 5.0, 5.0, 5.0])
    # Half a width of 0.2 m at 1 m is 0.2 rad: two steps of 0.1 rad and one to be safe.
    assert list(widen_edges(ranges, 0.1, 0.2, 0.5)) == [1.0, 1.0, 1.0, 1.0, 1.0, 5.0]
