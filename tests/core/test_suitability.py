"""Which drivers are made for which vehicles."""

import pytest

from race_server.core.driver import driver_named
from race_server.core.suitability import (
    check_suits,
    senses_of,
    suited,
    suits,
    suits_course,
    vehicles_of,
)
from race_server.core.vehicle_presets import KARTS, TENTH, VEHICLES
from race_server.errors import DriverError


def test_every_vehicle_that_a_driver_names_exists() -> None:
    names = {name for driver in suited("tt02") for name in vehicles_of(driver_named(driver))}
    assert names == {*TENTH, *KARTS}
    assert names <= set(VEHICLES)


def test_tentacles_are_for_the_1_10_car_and_the_raceline_for_karts_too() -> None:
    assert {"tentacles", "raceline"} <= set(suited("tt02"))
    assert suited("kart-60", ["raceline", "tentacles", "follow_gap"]) == ("raceline", "follow_gap")


def test_a_vehicle_without_slip_is_the_same_vehicle() -> None:
    assert suits(driver_named("tentacles"), "tt02-kinematic")
    assert not suits(driver_named("tentacles"), "kart-60-kinematic")


def test_a_driver_without_a_map_is_not_for_a_course_with_grass() -> None:
    assert suits_course(driver_named("follow_gap"), 0.0)
    assert not suits_course(driver_named("follow_gap"), 4.5)
    assert suits_course(driver_named("radar_line"), 4.5)


def test_a_driver_that_does_not_say_drives_anything() -> None:
    class Foreign:
        preset = "lidar"

    assert vehicles_of(Foreign()) == ()  # type: ignore[arg-type]
    assert suits(Foreign(), "kart-60")  # type: ignore[arg-type]


def test_a_wrapped_driver_and_a_policy_say_what_theirs_is() -> None:
    assert vehicles_of(driver_named("unstuck:tentacles")) == TENTH
    assert vehicles_of(driver_named("learned:race")) == ("tt02",)


def test_an_unfit_driver_is_named_with_those_that_fit() -> None:
    check_suits(["raceline", "unstuck:follow_gap"], "kart-60", "")
    words = (
        r"driver avoider is made for .*kart-60, not for car; choose one that is \(none is .*\), or"
    )
    with pytest.raises(DriverError, match=words):
        check_suits(["avoider"], "car", ", or walk")
    with pytest.raises(DriverError, match=r"choose one that is \(avoider, follow_gap, .*raceline"):
        check_suits(["raceline", "mapper"], "kart-30", "")


def test_a_preset_tells_what_its_drivers_see() -> None:
    assert senses_of("lidar") == ("lidar",)
    assert senses_of("line") == ("map", "line", "karts")
    assert senses_of("lot_lidar") == ("lidar", "pose")
    assert senses_of("of-another-package") == ()
