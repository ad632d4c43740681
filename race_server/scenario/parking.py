"""Scenarios in which vehicles drive to their slots."""

from dataclasses import replace
from numbers import Real
from pathlib import Path

from race_server.core import codes
from race_server.core.bounds import LEAST_ROUND_S, MOST_ROUND_S
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import ScenarioError
from race_server.scenario.level import level_named
from race_server.scenario.lot.faults import small_slots
from race_server.scenario.lot.load import load_lot
from race_server.scenario.race import Rules, Scenario

# Nothing of a race but the clock; a touch is a crash.
LOT_RULES = Rules(
    laps=0,
    standing_start=False,
    countdown_s=0.0,
    wall_contact="retire",
    kart_contact="retire",
    items=False,
    catch_up=False,
    stuck_s=0.0,
    finish_limit_s=0.0,
)


def parking_scenario(
    lot: str | Path,
    *,
    vehicles: int = 1,
    vehicle: str = "",
    level: str = "",
    limit_s: float = 0.0,
) -> Scenario:
    """Return a scenario in which `vehicles` vehicles drive to slots of a lot.

    vehicle, level, limit_s: as the lot says, unless given.

    Raises:
        LotError, VehicleError, ScenarioError: one of them does not exist, or is no time limit; or
            the vehicle does not fit into the slots, and has to.
    """
    is_number = isinstance(limit_s, Real)
    if not is_number or (limit_s and not LEAST_ROUND_S <= limit_s <= MOST_ROUND_S):
        given = f"{limit_s:g}" if is_number else repr(limit_s)
        raise ScenarioError(
            f"time limit {given} s: choose {LEAST_ROUND_S:g} to {MOST_ROUND_S:g} s, or 0 for "
            "that of the lot"
        )
    course = load_lot(lot)
    assert course.lot is not None
    driven, wanted = (
        vehicle_named(vehicle or course.lot.vehicle),
        level_named(level or course.lot.level),
    )
    if wanted.fits:
        for fault in small_slots(course, driven, wanted):
            raise ScenarioError(f"{course.name}: {fault}")
    return Scenario(
        course,
        karts=vehicles,
        vehicles=(driven,),
        rules=replace(LOT_RULES, limit_s=limit_s or course.lot.limit_s),
        fitted=(codes.RADAR,),
        level=wanted,
    )
