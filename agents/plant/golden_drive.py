"""The drive that golden vectors are made of, and how long a turn of the unit takes."""

import math
import time
from dataclasses import replace

import numpy as np

from race_agents.plant.chauffeur import Chauffeur
from race_agents.plant.kart import Plant
from race_agents.plant.radar import ERRS, Floats, Person, Surroundings
from race_agents.plant.sensors import Sensors
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.fence import CourseFence
from race_agents.unit.golden import Turn
from race_agents.unit.orders import GivenOrders
from race_server.core.messages import Control
from race_server.core.peer import Peer
from race_server.core.vehicles import Vehicle
from race_server.scenario.track.course import Course

PERIOD_S = 0.02
# A person stands this far along the line from the start [m], so that the reflex has work, and
# leaves after this time [s]: the kart drives on.
PERSON_M, LEAVES_S = 60.0, 12.0
# A kart that tells where it is begins this share of a lap ahead, and drives a lap in these turns.
AHEAD, LAP_TURNS = 0.12, 10_000
SENSORS = Sensors(
    radar=ERRS, velocity_deviation=0.1, heading_deviation=0.01, fix_wild=0.02, fix_loss=0.05
)


def golden_turns(
    course: Course,
    vehicle: Vehicle,
    *,
    seconds: float,
    seed: int,
    person_m: float = PERSON_M,
    leaves_s: float = LEAVES_S,
) -> list[Turn]:
    """Return the turns of a drive with every sensor, with faults, and with a person in the way."""
    line = course.line
    chauffeur = Chauffeur.of(line, vehicle, 0.5)
    start = tuple(float(value) for value in line[0, :3])
    ahead = line[round(person_m / chauffeur.spacing) % len(line)]
    around = Surroundings(course.borders, people=[Person(float(ahead[0]), float(ahead[1]), 0.25)])
    corners = tuple(
        (float(x), float(y))
        for x in (line[:, 0].min() - 5.0, line[:, 0].max() + 5.0)
        for y in (line[:, 1].min() - 5.0, line[:, 1].max() + 5.0)
    )
    sensors = replace(SENSORS, beacons=corners, range_s=0.1, range_detours=0.1)
    plant = Plant.of(vehicle, around, (start[0], start[1], start[2]), sensors, seed)
    fence = CourseFence.of(line, course.half_widths, course.kerb, course.borders)
    unit = ControlUnit.of(vehicle, fence)
    turns = []
    for number in range(round(seconds / PERIOD_S)):
        now_s = number * PERIOD_S
        if now_s >= leaves_s:
            around.people.clear()
        wanted = chauffeur.act(plant.body)
        cap = math.inf if number % 500 < 400 else 5.0
        turn = Turn(
            plant.read(now_s),
            Control(wanted.steering, wanted.throttle, wanted.brake),
            GivenOrders(min(cap, 99.0), 1.0),
            _peer_ahead(line, number / LAP_TURNS, now_s),
        )
        turns.append(turn)
        unit.sense(turn.readings)
        unit.hear(turn.orders, now_s)
        unit.drive(turn.control, now_s)
        unit.hear_peers(turn.peers)
        plant.act(unit.decide(now_s))
    return turns


def _peer_ahead(line: Floats, share: float, now_s: float) -> tuple[Peer, ...]:
    """Return what a kart tells that crawls along the line and brakes every other second.

    share: of the lap that it has driven.
    """
    place = int((AHEAD + share) * len(line)) % len(line)
    x, y, heading = (float(value) for value in line[place, :3])
    stamp_us = round((now_s - 0.03) * 1e6)
    braking = 6.0 * (int(now_s) % 2)
    return (Peer(stamp_us, x, y, heading, 2.0, 0.0, 0.0, braking, 0.02, 0.01, 1.9, 1.3),)


def turn_times(vehicle: Vehicle, fence: CourseFence, turns: list[Turn], passes: int = 5) -> Floats:
    """Return the time of each turn of sense and decide [s]: the least of some passes.

    So what else the machine does in a turn does not count.
    """
    return np.min([_times(vehicle, fence, turns) for _ in range(passes)], axis=0)


def _times(vehicle: Vehicle, fence: CourseFence, turns: list[Turn]) -> list[float]:
    unit, times = ControlUnit.of(vehicle, fence), []
    for turn in turns:
        begun = time.perf_counter()
        unit.sense(turn.readings)
        unit.hear(turn.orders, turn.readings.time_s)
        unit.drive(turn.control, turn.readings.time_s)
        unit.hear_peers(turn.peers)
        unit.decide(turn.readings.time_s)
        times.append(time.perf_counter() - begun)
    return times
