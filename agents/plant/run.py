"""One plant in one race: its place on the grid, its view of the others, its report."""

import json
import random
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from race_agents.onboard.client import VALET, take_part
from race_agents.plant.incident import IncidentLog, PersonIncident, RadioLoss
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Surroundings
from race_agents.plant.scene import Scene
from race_agents.plant.sensors import Sensors
from race_server.core.driver import driver_named
from race_server.errors import DriverError
from race_server.live.client.seat import ClientSeat
from race_server.net.auth.keys import ClientKeys
from race_server.net.transport import ClientLink
from race_server.net.wire.lobby import CourseSheet

# [rad] deviation of the heading that two antennas tell.
HEADING_DEVIATION = 0.01


@dataclass(frozen=True)
class PlantSetting:
    """One plant and what is to happen to it."""

    driver: str = "pure_pursuit"
    valet: str = VALET  # parks the kart where the driver races
    on_request: bool = False  # a driver that parks waits until the server orders it
    seat: int = -1
    address: str = ""
    session: str = "race"
    keys: ClientKeys | None = None
    patience_s: float = 20.0
    delay_s: float = 0.0  # each way
    sensors: Sensors = field(default_factory=Sensors)
    seed: int = 0
    caution: float = 0.6
    pedestrian_s: float | None = None
    cut_s: float | None = None
    report: Path | None = None


def run_plant(setting: PlantSetting) -> None:
    """Drive one race with a plant, or all of an event, and write its report on the last one."""
    chance = random.Random(setting.seed)
    offset_s = chance.uniform(1e3, 1e6)  # no kart's clock shows the server's time
    logs: list[IncidentLog] = []

    def hardware_of(seat: ClientSeat, sheet: CourseSheet, link: ClientLink) -> Plant:
        plant = _plant_for(setting, seat, sheet, link)
        person = PersonIncident(setting.pedestrian_s) if setting.pedestrian_s is not None else None
        radio_loss = RadioLoss(setting.cut_s) if setting.cut_s is not None else None
        logs.append(IncidentLog(plant, person, radio_loss))
        return plant

    try:
        take_part(
            driver_named(setting.driver),
            hardware_of,
            name=f"real {setting.driver}",
            address=setting.address,
            session=setting.session,
            keys=setting.keys,
            wanted=setting.seat,
            timeout_s=setting.patience_s,
            delay_s=setting.delay_s,
            caution=setting.caution,
            valet=setting.valet,
            on_request=setting.on_request,
            clock=lambda: time.monotonic() + offset_s,
            each_turn=lambda *turn: logs[-1].turn(*turn),
        )
    finally:
        if setting.report is not None and logs:
            setting.report.write_text(json.dumps(logs[-1].summary()))


def _plant_for(
    setting: PlantSetting, seat: ClientSeat, sheet: CourseSheet, link: ClientLink
) -> Plant:
    """Return the plant: on its place on the grid, or in a car park where its round begins.

    Raises:
        DriverError: its vehicle draws trailers.
    """
    welcome, is_lot = seat.welcome, not len(sheet.line)
    vehicle, briefing, sensors = welcome.briefing.vehicle, welcome.briefing, setting.sensors
    if vehicle.trailers:
        raise DriverError(f"{vehicle.name} draws trailers, which no plant has: choose another one")
    around = Surroundings(sheet.borders)
    if is_lot or len(sheet.slots):
        sensors = replace(
            sensors,
            lidar_rays=welcome.lidar_rays,
            lidar_field=briefing.lidar_field,
            lidar_reach=briefing.lidar_reach,
            heading_deviation=HEADING_DEVIATION,
        )
    scene = Scene(link, seat.number, around, is_lot=is_lot)
    if is_lot:
        plant = Plant.of(vehicle, around, (0.0, 0.0, 0.0), sensors, setting.seed, scene.look)
        plant.find = scene.find
        return plant
    x, y, heading = (float(value) for value in sheet.grid[seat.number])
    return Plant.of(vehicle, around, (x, y, heading), sensors, setting.seed, scene.look)
