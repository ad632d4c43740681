"""A real kart as tests drive one: a plant beside the program, and a driver with a light foot."""

from race_agents.onboard.grounds import fence_of
from race_agents.onboard.kart import KartHere
from race_agents.onboard.safety_side import Mailboxes, SafetySide
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Surroundings
from race_agents.plant.sensors import Sensors
from race_agents.unit.control_unit import ControlUnit
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.live.client.seat import ClientSeat
from race_server.net.transport import ClientLink
from race_server.net.wire.lobby import CourseSheet


class Gentle:
    """Drives straight on with a light foot."""

    preset = "track"

    def reset(self, briefing: object) -> None:
        pass

    def act(self, seen: Observation) -> Control:
        return Control(0.0, 0.3 if seen.scalar("lights") == 0.0 else 0.0)


def kart_of(seat: ClientSeat, sheet: CourseSheet, link: ClientLink) -> KartHere:
    del link
    x, y, heading = (float(value) for value in sheet.grid[seat.number])
    vehicle = seat.welcome.briefing.vehicle
    plant = Plant.of(vehicle, Surroundings(sheet.borders), (x, y, heading), Sensors(), seed=1)
    unit = ControlUnit.of(vehicle, fence_of(sheet))
    return KartHere(SafetySide(unit, plant, Mailboxes.over(bytearray(Mailboxes.size()))))
