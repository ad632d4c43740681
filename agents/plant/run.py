"""One plant in one race: its place on the grid, its view of the others, its report."""

import random
import time
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from race_agents.onboard.client import VALET, take_part
from race_agents.onboard.grounds import fence_of
from race_agents.onboard.kart import Kart, KartApart
from race_agents.onboard.program import KartProgram
from race_agents.onboard.safety_side import Mailboxes
from race_agents.plant.safety_process import PlantSetup
from race_agents.plant.scene import Scene
from race_agents.plant.sensors import Sensors
from race_agents.plant.sight import SCENE_BYTES, mailbox_over
from race_server.coaching.assistance import Level
from race_server.core.driver import driver_named
from race_server.errors import DriverError
from race_server.live.client.seat import ClientSeat
from race_server.net.auth.keys import ClientKeys
from race_server.net.transport import ClientLink, Mailbox
from race_server.net.wire import topics
from race_server.net.wire.lobby import CourseSheet

SAFETY = "race_agents.plant.safety_process"
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
    kill_at: float | None = None  # [m/s]
    beside: str = ""  # address of this machine, see `take_part`
    peers: tuple[str, ...] = ()  # addresses of real karts, see `take_part`
    level: Level = Level.NONE  # of the help for the driver's pedals
    report: Path | None = None
    black_box: Path | None = None
    only_incidents: bool = False  # what the black box keeps


def run_plant(setting: PlantSetting) -> None:
    """Drive one race, or all of an event, with a plant, whose safety side is a process apart."""
    offset_s = random.Random(setting.seed).uniform(1e3, 1e6)  # no kart's clock shows the server's
    scenes: list[Scene] = []

    def kart_of(seat: ClientSeat, sheet: CourseSheet, link: ClientLink) -> KartApart:
        setup = _setup_of(setting, seat, sheet, offset_s)
        if scenes and (box := setup.black_box):  # each round of an event has one
            setup = replace(setup, black_box=box.with_stem(f"{box.stem}-{len(scenes) + 1}"))
        kart = KartApart(SAFETY, setup, SCENE_BYTES)
        try:
            scenes.append(_scene_of(seat, link, kart, is_lot=setup.is_lot))
        except BaseException:
            kart.close()
            raise
        return kart

    def each_turn(_program: KartProgram, _kart: Kart, now_s: float) -> bool:
        scenes[-1].turn(now_s)
        return True

    take_part(
        driver_named(setting.driver),
        kart_of,
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
        beside=setting.beside,
        peers=setting.peers,
        level=setting.level,
        clock=lambda: time.monotonic() + offset_s,
        each_turn=each_turn,
    )


def _scene_of(seat: ClientSeat, link: ClientLink, kart: KartApart, *, is_lot: bool) -> Scene:
    """Return what passes on to a plant what is around it."""
    snapshots, lots = Mailbox(), Mailbox()
    link.listen(topics.SNAPSHOT, snapshots.put)
    if is_lot:
        link.listen(topics.LOT, lots.put)
    return Scene(
        *(seat.number, mailbox_over(kart.memory, Mailboxes.size())),
        *(partial(snapshots.take, 0.0), partial(lots.take, 0.0) if is_lot else None),
    )


def _setup_of(
    setting: PlantSetting, seat: ClientSeat, sheet: CourseSheet, offset_s: float
) -> PlantSetup:
    """Return a plant: on its place on the grid, or in a car park where its round begins.

    Raises:
        DriverError: its vehicle draws trailers.
    """
    welcome, is_lot = seat.welcome, not len(sheet.line)
    vehicle, briefing, sensors = welcome.briefing.vehicle, welcome.briefing, setting.sensors
    if vehicle.trailers:
        raise DriverError(f"{vehicle.name} draws trailers, which no plant has: choose another one")
    if is_lot or len(sheet.slots):
        sensors = replace(
            sensors,
            lidar_rays=welcome.lidar_rays,
            lidar_field=briefing.lidar_field,
            lidar_reach=briefing.lidar_reach,
            heading_deviation=HEADING_DEVIATION,
        )
    place = None
    if not is_lot:
        x, y, heading = (float(value) for value in sheet.grid[seat.number])
        place = x, y, heading
    return PlantSetup(
        *(vehicle, fence_of(sheet), sheet.borders, place, sensors, setting.seed, offset_s, is_lot),
        *(setting.pedestrian_s, setting.cut_s, setting.kill_at, setting.report),
        black_box=setting.black_box,
        only_incidents=setting.only_incidents,
    )
