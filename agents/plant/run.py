"""One plant in one race: its place on the grid, its view of the others, its report."""

import json
import random
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from race_agents.onboard.client import take_part
from race_agents.plant.incident import IncidentLog, PersonIncident, RadioLoss
from race_agents.plant.kart import Plant, Sensors
from race_agents.plant.radar import Floats, Surroundings
from race_server.core.driver import driver_named
from race_server.core.messages import KartFlag, Status
from race_server.errors import WireError
from race_server.live.client.seat import ClientSeat
from race_server.net.auth.keys import ClientKeys
from race_server.net.transport import ClientLink, Mailbox
from race_server.net.wire import topics
from race_server.net.wire.lobby import CourseSheet
from race_server.net.wire.spectate import decode_snapshot

PARKED = 64  # bit of a kart's flags in a snapshot: no sensor sees it


@dataclass(frozen=True)
class PlantSetting:
    """One plant and what is to happen to it."""

    driver: str = "pure_pursuit"
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


class Others:
    """The other karts, as every client may see them."""

    def __init__(self, link: ClientLink, own: int) -> None:
        """Begin to listen. own: the seat that is left out."""
        self._mailbox = Mailbox()
        self._own = own
        link.listen(topics.SNAPSHOT, self._mailbox.put)

    def __call__(self) -> Floats | None:
        """Return them, shape (n, 5): x, y, heading, velocity; None if there is nothing new."""
        data = self._mailbox.take(0.0)
        if data is None:
            return None
        try:
            karts = decode_snapshot(data).karts
        except WireError:
            return None  # the next one comes in a sixtieth of a second
        there = (karts["seat"] != self._own) & (karts["status"] == Status.RACING)
        karts = karts[there & (karts["flags"] & KartFlag.SUSPENDED == 0)]
        cos, sin = np.cos(karts["heading"]), np.sin(karts["heading"])
        vx = karts["speed"] * cos - karts["lateral_speed"] * sin
        vy = karts["speed"] * sin + karts["lateral_speed"] * cos
        rows = (karts["x"], karts["y"], karts["heading"], vx, vy)
        return np.stack(rows, axis=1).astype(np.float64)


def run_plant(setting: PlantSetting) -> None:
    """Drive one race with a plant and write its report."""
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
            clock=lambda: time.monotonic() + offset_s,
            each_turn=lambda *turn: logs[0].turn(*turn),
        )
    finally:
        if setting.report is not None and logs:
            setting.report.write_text(json.dumps(logs[0].summary()))


def _plant_for(
    setting: PlantSetting, seat: ClientSeat, sheet: CourseSheet, link: ClientLink
) -> Plant:
    """Return the plant on its place on the grid."""
    x, y, heading = (float(value) for value in sheet.grid[seat.number])
    return Plant.of(
        seat.welcome.briefing.vehicle,
        Surroundings(sheet.borders),
        (x, y, heading),
        setting.sensors,
        setting.seed,
        Others(link, seat.number),
    )
