"""Scenarios in which vehicles drive to their slots."""

from dataclasses import replace

from race_server.core import codes
from race_server.core.vehicle_presets import vehicle_named
from race_server.scenario.level import level_named
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
    lot: str,
    *,
    vehicles: int = 1,
    vehicle: str = "",
    level: str = "",
    limit_s: float = 0.0,
) -> Scenario:
    """Return a scenario in which `vehicles` vehicles drive to slots of a lot.

    vehicle, level, limit_s: as the lot says, unless given.

    Raises:
        LotError, VehicleError, ScenarioError: one of them does not exist.
    """
    course = load_lot(lot)
    assert course.lot is not None
    return Scenario(
        course,
        karts=vehicles,
        vehicles=(vehicle_named(vehicle or course.lot.vehicle),),
        rules=replace(LOT_RULES, limit_s=limit_s or course.lot.limit_s),
        fitted=(codes.RADAR,),
        level=level_named(level or course.lot.level),
    )
