"""Small car parks for tests, made without a file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from race_server.core.driver import Briefing
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import World
from race_server.core.step import advance
from race_server.core.vehicle_presets import KART_13
from race_server.core.vehicles import Vehicle
from race_server.scenario.level import level_named
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.site import course_of_lot
from race_server.scenario.parking import LOT_RULES
from race_server.scenario.race import Scenario, make_world
from race_server.scenario.track.course import Course
from race_server.scenario.track.lot import Lot, People, Zone
from race_server.session.session import Session

# A file of one bay at the right end of an area; further keys go before it, tables behind it.
ONE_BAY = """
area = [0, 40, 0, 20]
vehicle = "car"
[[rows]]
at = [30, 10]
length = 5.2
width = 2.5
[[zones]]
role = "start"
x = [5, 10]
y = [5, 15]
"""

AHEAD = KART_13.box_offset  # [m] from the centre of gravity to the middle of the body


def load_text(folder: Path, text: str) -> Course:
    """Return the car park of a file with this text, called `lot.toml`."""
    path = folder / "lot.toml"
    path.write_text(text)
    return load_lot(str(path))


def one_slot(length: float = 3.0, width: float = 2.0, people: int = 0) -> Course:
    """Return an area of 100 m by 100 m whose one slot lies in the middle and points east."""
    zones = (Zone("start", (-20.0, -20.0), (0.0, 0.0)), Zone("people", (30.0, 40.0), (30.0, 40.0)))
    slots = np.array([(0.0, 0.0, 0.0, length, width)])
    lot = Lot(slots, zones, people=People(count=people))
    return course_of_lot("one-slot", "One slot", (-50.0, 50.0, -50.0, 50.0), (), lot, "one-slot")


def open_lot(vehicles: int = 2, people: int = 0) -> Course:
    """Return an area of 100 m by 100 m with `vehicles` slots, 10 m apart along y.

    People walk beyond the slots.
    """
    slots = np.array([(0.0, 10.0 * number, 0.0, 3.0, 2.0) for number in range(vehicles)])
    zones = (
        Zone("start", (-40.0, -20.0), (-40.0, 40.0)),
        Zone("people", (30.0, 40.0), (0.0, 40.0)),
    )
    lot = Lot(slots, zones, people=People(count=people))
    return course_of_lot("open", "Open", (-50.0, 50.0, -50.0, 50.0), (), lot, "open")


def park_world(
    course: Course,
    *,
    level: str = "parked",
    vehicles: int = 1,
    bump: bool = False,
    seed: int = 3,
    limit_s: float = 60.0,
    vehicle: Vehicle = KART_13,
) -> World:
    """Return a world of vehicles of one kind in a car park."""
    contact = "bump" if bump else "retire"
    rules = replace(LOT_RULES, wall_contact=contact, kart_contact=contact, limit_s=limit_s)
    scenario = Scenario(
        course,
        karts=vehicles,
        vehicles=(vehicle,),
        rules=rules,
        seed=seed,
        level=level_named(level),
    )
    return make_world(scenario)


def put(
    world: World, x: float, y: float, heading: float = 0.0, *, speed: float = 0.0, kart: int = 0
) -> None:
    """Put a kart so that the middle of its body is at (x, y) [m]."""
    body = world.bodies[0, kart]
    body.x, body.y = x - AHEAD * np.cos(heading), y - AHEAD * np.sin(heading)
    body.heading, body.speed = heading, speed


def put_axle(
    world: World, x: float, y: float, heading: float = 0.0, *, bend: float = 0.0, kart: int = 0
) -> None:
    """Put a vehicle so that its rear axle is at (x, y) [m]. bend: [rad] at its first hitch."""
    body, ahead = world.bodies[0, kart], float(world.vehicles[0, kart].rear_axle)
    body.x, body.y = x + ahead * np.cos(heading), y + ahead * np.sin(heading)
    body.heading = heading
    body.trailers["heading"] = heading - bend


def wait(world: World, ticks: int) -> None:
    """Let time pass with all brakes on."""
    controls = np.zeros((*world.bodies.shape, 4))
    controls[..., 2] = 1.0
    advance(world, controls, ticks)


def roll(world: World, ticks: int) -> None:
    """Let time pass without any control."""
    advance(world, np.zeros((*world.bodies.shape, 4)), ticks)


class Beeline:
    """Drives straight at its slot, slower the nearer it is, and stands there.

    It parks where nothing is in the way and the slot lies ahead; it keeps the orders it was given.
    """

    preset = "lot"

    def __init__(self) -> None:
        """Begin without an order."""
        self.orders: list[ParkingOrder] = []

    def reset(self, briefing: Briefing) -> None:
        """Forget the orders of the last race."""
        self.orders.clear()

    def park(self, order: ParkingOrder) -> None:
        """Keep an order."""
        self.orders.append(order)

    def act(self, observation: Observation) -> Control:
        """Return a control towards the middle of the slot."""
        ahead, left = observation.scalar("goal_x"), observation.scalar("goal_y")
        wanted = min(0.5 * ahead, 2.0) if abs(ahead) > 0.02 else 0.0
        push = wanted - observation.scalar("speed")
        steering = 0.0 if ahead < 0.5 else 2.0 * np.arctan2(left, ahead)
        if abs(ahead) < 0.05:
            return Control(brake=1.0)
        return Control(float(np.clip(steering, -1.0, 1.0)), float(np.clip(push, -1.0, 1.0)))


def lot_session(
    course: Course, vehicles: int = 1, *, seed: int = 3, limit_s: float = 60.0, level: str = "goal"
) -> Session:
    """Return a session in its lobby in a car park, with a countdown of half a second."""
    rules = replace(LOT_RULES, limit_s=limit_s, countdown_s=0.5)
    scenario = Scenario(*(course, vehicles, (KART_13,), rules), seed=seed, level=level_named(level))
    return Session("lot", scenario)
