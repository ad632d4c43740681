"""The safety side of a plant, as a process: ``python -m race_agents.plant.safety_process PATH``.

PATH is the shared memory; the setup comes pickled over standard input from the program that started
this one. It has no link: without words of the other side it brakes, stands, and ends.
"""

import json
import mmap
import pickle
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from race_agents.onboard.black_box import BlackBox
from race_agents.onboard.incident_ring import IncidentRing
from race_agents.onboard.safety_side import PERIOD_S, Mailboxes, SafetySide
from race_agents.plant.incident import GameLoss, IncidentLog, PersonIncident, RadioLoss
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Floats, Surroundings
from race_agents.plant.sensors import Sensors
from race_agents.plant.sight import Sight, mailbox_over
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.fence import Fence
from race_agents.unit.mailbox import Memory
from race_server.core.clock import Pacer
from race_server.core.vehicles import Vehicle


@dataclass(frozen=True)
class PlantSetup:
    """One plant, and what is to happen to it."""

    vehicle: Vehicle
    fence: Fence
    borders: Floats  # (P, 4)
    place: tuple[float, float, float] | None  # on the grid; None: where a round puts it
    sensors: Sensors
    seed: int
    offset_s: float  # of the kart's clock
    is_lot: bool
    pedestrian_s: float | None = None
    cut_s: float | None = None
    kill_at: float | None = None  # [m/s]
    report: Path | None = None
    black_box: Path | None = None
    only_incidents: bool = False  # what the black box keeps


def side_of(setup: PlantSetup, memory: Memory) -> tuple[SafetySide, IncidentLog]:
    """Return the safety side of a plant over shared memory, and what keeps its figures."""
    around = Surroundings(setup.borders)
    sight = Sight(mailbox_over(memory, Mailboxes.size()), around, setup.is_lot)
    plant = Plant.of(
        *(setup.vehicle, around, setup.place or (0.0, 0.0, 0.0)),
        *(setup.sensors, setup.seed, sight.look),
    )
    if setup.place is None:
        plant.find = sight.find
    person = PersonIncident(setup.pedestrian_s) if setup.pedestrian_s is not None else None
    radio_loss = RadioLoss(setup.cut_s) if setup.cut_s is not None else None
    game_loss = GameLoss(setup.kill_at) if setup.kill_at is not None else None
    log = IncidentLog(plant, person, radio_loss, game_loss)
    unit = ControlUnit.of(setup.vehicle, setup.fence)
    ring = IncidentRing() if setup.only_incidents else None
    box = BlackBox(setup.black_box, ring) if setup.black_box is not None else None
    return SafetySide(unit, plant, Mailboxes.over(memory), log.turn, box), log


def main(path: str) -> None:
    """Turn until the other side ends this process, or has been silent for long."""
    setup: PlantSetup = pickle.load(sys.stdin.buffer)
    with Path(path).open("r+b") as file:
        memory = mmap.mmap(file.fileno(), 0)
    signal.signal(signal.SIGTERM, _leave)
    side, log = side_of(setup, memory)
    pacer = Pacer(PERIOD_S)
    pacer.start()
    try:
        now_s = time.monotonic() + setup.offset_s
        while not side.is_alone(now_s):
            side.turn(now_s)
            pacer.wait()
            now_s = time.monotonic() + setup.offset_s
    except (KeyboardInterrupt, SystemExit):
        pass
    finally:
        side.stop()
        if setup.report is not None and setup.report.parent.exists():
            setup.report.write_text(json.dumps(log.summary()))


def _leave(*_: object) -> NoReturn:
    raise SystemExit


if __name__ == "__main__":
    main(sys.argv[1])
