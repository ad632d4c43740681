"""A kart meets a person or a kart, on a straight way, its driver on the throttle.

The shapes are those of the Euro NCAP protocols for pedestrians and cars ahead (AEB VRU, AEB C2C):
CPLA walks ahead, CPNA and CPFA cross from the near and the far side, CPNCO is a child from behind
parked vehicles; CCRs stands, CCRm drives 20 km/h, CCRb brakes. They are shapes, not a rating.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from race_agents.plant.gaps import gap_between
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Floats, Person, Surroundings, gap_to, outlines_of
from race_agents.plant.sensors import Sensors
from race_agents.plant.told import Move, Told, heading_of
from race_agents.unit.control_unit import ControlUnit
from race_server.core.alert import Cause, DangerStage
from race_server.core.messages import Control, Flag, Trust
from race_server.core.vehicles import Vehicle

KMH = 1.0 / 3.6
PERIOD_S = 0.02
RUN_IN_S = 2.5  # the kart drives at its speed before the meeting
BEGIN_S = 4.0  # time before the meeting from which on it counts
AFTER_S = 3.0
WALKS, HASTES, DRIVES = 5.0 * KMH, 8.0 * KMH, 20.0 * KMH
ADULT, CHILD = 0.25, 0.2  # [m] radius
# A kart ahead brakes with this [m/s²] from this far ahead [m].
BRAKES, FOLLOWS = 4.0, 12.0
# A parked kart's side is this far beside the way of the body [m].
PARKED_ASIDE = 1.0


class OpenPlace:
    """A fence round nothing: the kart may be anywhere, and faces east."""

    borders: None = None

    def beyond(self, x: float, y: float) -> float:
        """Return that every point is inside."""
        del x, y
        return -math.inf

    def heading_at(self, x: float, y: float) -> float:
        """Return east."""
        del x, y
        return 0.0


@dataclass(frozen=True)
class FreeRun:
    """Orders of a race without limits."""

    epoch: int = 1
    tick: int = 1
    sequence: int = 1
    speed_cap: float = math.inf
    thrust_scale: float = 1.0
    grip_scale: float = 1.0
    valid_s: float = math.inf
    monotonic_us: int = 0
    lights_s: float = 0.0
    flag: Flag = Flag.GREEN
    trust: Trust = Trust.TRUSTED


@dataclass(frozen=True)
class Case:
    """One meeting. `place` gives the object's x, y, vx, vy [m, m/s] by the time to the meeting.

    The meeting is where front bumper and object would touch if the kart did not brake: at x = 0.
    """

    name: str
    speed: float  # [m/s] of the kart
    place: Move
    radius: float | None = ADULT  # None: a kart
    hidden_by: tuple[tuple[float, float], ...] = ()  # x, y of parked karts
    before: Move | None = None  # a kart that drives between the two
    share: float = 0.5  # of the width, where the kart would hit who it meets


@dataclass
class Outcome:
    """How a meeting went."""

    impact: float | None = None  # [m/s] of the kart over the other's, None: avoided
    warned_s: float = math.inf  # by the time since it counts
    braked_s: float = math.inf
    seen_s: float = math.inf
    least_gap: float = math.inf
    stages: list[int] = field(default_factory=list)

    @property
    def lead_s(self) -> float:
        """How long the warning came before full brakes [s]."""
        return self.braked_s - self.warned_s


def meet(
    case: Case, vehicle: Vehicle, sensors: Sensors, seed: int, *, told: bool = False
) -> Outcome:
    """Let a plant as built from a seed have a meeting, its driver's foot down.

    told: the karts that drive, and the one that is met, tell where they are.
    """
    nose = vehicle.box_offset + 0.5 * vehicle.length
    start = -nose - case.speed * (RUN_IN_S + BEGIN_S)
    around = Surroundings(np.zeros((0, 4)))
    plant = Plant.of(vehicle, around, (start, 0.0, 0.0), replace(sensors, fix_delay_s=0.0), seed)
    plant.body.speed, plant.body.brake = case.speed, 0.0
    unit = ControlUnit.of(vehicle, OpenPlace())
    radio = Told(vehicle, np.random.default_rng([seed, 1])) if told else None
    movers = [each for each in (case.before, case.place) if each is not None]
    outcome, turns = Outcome(), round((RUN_IN_S + BEGIN_S + AFTER_S) / PERIOD_S)
    for turn in range(turns):
        now_s = turn * PERIOD_S
        until_s = RUN_IN_S + BEGIN_S - now_s
        _arrange(case, around, until_s)
        if radio is not None:
            unit.hear_peers(radio.hear(movers, until_s, now_s))
        unit.sense(plant.read(now_s))
        unit.hear(FreeRun(), now_s)
        missing = case.speed - plant.body.speed
        unit.drive(Control(0.0, max(0.05, min(0.25 + 0.8 * missing, 1.0))), now_s)
        plant.act(unit.decide(now_s))
        if now_s >= RUN_IN_S:
            _note(case, outcome, plant, unit, now_s - RUN_IN_S)
        if outcome.impact is not None or abs(plant.body.speed) < 0.02:
            break
    return outcome


def _arrange(case: Case, around: Surroundings, until_s: float) -> None:
    """Put all where they are this time before the meeting."""
    x, y, vx, vy = case.place(until_s)
    rows = [(px, py, 0.0, 0.0, 0.0) for px, py in case.hidden_by]
    if case.before is not None:
        rows.append(_row_of(case.before(until_s)))
    if case.radius is None:
        rows.append(_row_of((x, y, vx, vy)))
        around.people.clear()
    else:
        around.people[:] = [Person(x, y, case.radius, vx, vy)]
    around.others = np.array(rows).reshape(-1, 5)


def _row_of(kart: tuple[float, float, float, float]) -> tuple[float, float, float, float, float]:
    """Return a kart as its surroundings have it: x, y, heading, velocity."""
    x, y, vx, vy = kart
    return x, y, heading_of(vx, vy), vx, vy


def _note(case: Case, outcome: Outcome, plant: Plant, unit: ControlUnit, now_s: float) -> None:
    body, stage = plant.body, unit.danger.stage
    if stage >= DangerStage.WARN:
        outcome.warned_s = min(outcome.warned_s, now_s)
    if unit.command.brake >= 1.0 and unit.command.cause & Cause.OBSTACLE:
        outcome.braked_s = min(outcome.braked_s, now_s)
        outcome.warned_s = min(outcome.warned_s, now_s)
    if stage >= DangerStage.INFORM:
        outcome.seen_s = min(outcome.seen_s, now_s)
    if case.radius is not None:
        gap = gap_to(plant.around.people[0], body)
        relative = body.speed
    else:
        row = plant.around.others[-1]
        gap = _gap_of_karts(row, plant)
        relative = body.speed - float(row[3])
    outcome.least_gap = min(outcome.least_gap, gap)
    if gap <= 0.0:
        outcome.impact = max(relative, 0.0)


def _gap_of_karts(row: Floats, plant: Plant) -> float:
    """Return the gap [m] between the outlines of two karts, if they are near each other."""
    body, vehicle = plant.body, plant.body.vehicle
    if math.hypot(float(row[0]) - body.x, float(row[1]) - body.y) > 2.0 * vehicle.length:
        return math.inf
    own = outlines_of(np.array([[body.x, body.y, body.heading]]), vehicle)
    return gap_between(own, outlines_of(row[None], vehicle))
