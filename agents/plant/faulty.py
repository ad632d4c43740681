"""A kart in which something fails at speed: a plant, both sides of its program, and the fault.

The safety side turns 100 times a second over its mailboxes, as in the kart. The game's side drives
by what the safety side reports: the estimate, never the truth.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from race_agents.onboard.safety_side import PERIOD_S, Mailboxes, SafetySide
from race_agents.plant.body import Body
from race_agents.plant.chauffeur import Chauffeur
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Surroundings
from race_agents.plant.sensors import Sensors
from race_agents.plant.trip import Course
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.fence import CourseFence
from race_agents.unit.orders import GivenOrders
from race_agents.unit.readings import Readings
from race_agents.unit.records import Word
from race_agents.unit.safety import Command
from race_server.core.messages import Control
from race_server.core.telemetry import Sensor, SensorState
from race_server.core.vehicles import Vehicle

KMH = 1.0 / 3.6
# The kart drives at least this long [s] before, and then from this speed [m/s] on; at the latest …
SETTLE_S, AT, LATEST_S = 8.0, 50.0 * KMH, 30.0
AFTER_S = 12.0
# A kart that stands while something fails drives off after this time [s].
WAITS_S = 1.0
STANDS = 0.05  # [m/s]
GRIP_SHARE = 0.6

Change = Callable[[Readings, "Scene"], Readings]


@dataclass
class Scene:
    """What a fault may need to know."""

    since_s: float = 0.0  # how long it has lasted
    kept: dict[str, Any] = field(default_factory=dict)

    def first(self, name: str, value: Any) -> Any:
        """Return the value that came first by this name: a sensor that hangs repeats it."""
        return self.kept.setdefault(name, value)


@dataclass(frozen=True)
class Fault:
    """Something that fails: in the readings, in the words of the game's side, or in its orders."""

    name: str
    what: str
    readings: Change = lambda readings, _: readings
    control: Callable[[Control], Control] = lambda control: control
    orders: Callable[[GivenOrders], GivenOrders | None] = lambda orders: orders  # None: no radio
    silent: bool = False  # the game's side writes no word
    damaged_every: int = 0  # one of this many words is damaged; 0: none
    clock_s: float = 0.0  # by which the kart's clock jumps
    sensors: Sensors = field(default_factory=Sensors)
    standing: bool = False  # it fails while the kart stands, which then drives off


@dataclass
class Faulty:
    """A plant whose readings pass through a fault."""

    plant: Plant
    fault: Fault
    scene: Scene | None = None  # None: not yet
    clock_s: float = 0.0

    def read(self, now_s: float) -> Readings:
        """Return the readings, as the fault leaves them; the body moves by its own clock."""
        readings = self.plant.read(now_s - self.clock_s)
        if self.clock_s:
            readings = replace(readings, time_s=now_s)
        return readings if self.scene is None else self.fault.readings(readings, self.scene)

    def act(self, command: Command) -> None:
        """Move the actuators."""
        self.plant.act(command)

    def hands(self, control: Control | None, now_s: float) -> Control | None:
        """Return the driver's input."""
        return self.plant.hands(control, now_s)


@dataclass
class Happened:
    """What a kart did after something had failed."""

    speed: float = 0.0  # [m/s] when it failed
    flagged: dict[str, float] = field(default_factory=dict)  # sensor and its state: after [s]
    causes: dict[str, float] = field(default_factory=dict)  # of what it did by itself: after [s]
    stood_s: float | None = None
    way_m: float = 0.0  # until it stood
    last: float = 0.0  # [m/s] at most in the last seconds
    off_m: float = 0.0  # how far its place was off at most
    lied_m: float = 0.0  # … beyond three of the deviations that it told
    scraped: float = 0.0  # [m/s] at which it touched a border, at most

    def note(self, after_s: float, side: SafetySide, plant: Plant, scrapes: int) -> None:
        """Note a turn."""
        for sensor in Sensor:
            state = side.unit.watch.state(sensor)
            if state > SensorState.WELL:
                told = f"{sensor.name} {state.name}".lower()
                self.flagged.setdefault(told, round(after_s, 2))
        for cause in side.unit.command.cause.as_json():
            self.causes.setdefault(cause, round(after_s, 2))
        body, pose = plant.body, side.unit.pose()
        speed = math.hypot(body.speed, body.lateral_speed)
        if plant.scrapes > scrapes:
            self.scraped = max(self.scraped, speed)
        if pose is not None:
            off = math.hypot(pose.x - body.x, pose.y - body.y)
            self.off_m = max(self.off_m, off)
            self.lied_m = max(self.lied_m, off - 3.0 * pose.deviation)
        if self.stood_s is None:
            self.way_m += speed * PERIOD_S
            if speed < STANDS:
                self.stood_s = round(after_s, 2)
        if after_s > AFTER_S - 2.0:
            self.last = max(self.last, speed)


@dataclass
class Drive:
    """One kart on a course, until some time after its fault."""

    course: Course
    fence: CourseFence
    vehicle: Vehicle
    fault: Fault
    seed: int = 1

    def __post_init__(self) -> None:
        """Put the kart on the course."""
        line = self.course.line
        place = line[int(0.1 * self.seed * len(line)) % len(line)]
        start = float(place[0]), float(place[1]), float(place[2])
        plant = Plant.of(
            self.vehicle, Surroundings(self.course.borders), start, self.fault.sensors, self.seed
        )
        self.faulty = Faulty(plant, self.fault)
        unit = ControlUnit.of(self.vehicle, self.fence)
        self.side = SafetySide(unit, self.faulty, Mailboxes.over(bytearray(Mailboxes.size())))
        self._driver = Chauffeur.of(line, self.vehicle, GRIP_SHARE)
        self._word, self._orders = Word(), GivenOrders(math.inf, 1.0)

    def run(self) -> Happened:
        """Drive, let it fail, and return what happened."""
        happened, plant, turn, began = Happened(), self.faulty.plant, 0, math.inf
        while PERIOD_S * turn < began + AFTER_S:
            now_s = PERIOD_S * turn
            is_due = now_s > SETTLE_S and (self.fault.standing or plant.body.speed > AT)
            if began == math.inf and (is_due or now_s > LATEST_S):
                began, happened.speed = now_s, plant.body.speed
                self.faulty.scene, self.faulty.clock_s = Scene(), self.fault.clock_s
            if self.faulty.scene is not None:
                self.faulty.scene.since_s = now_s - began
            scrapes = plant.scrapes
            shown_s = now_s + self.faulty.clock_s
            if turn % 2 == 0:
                self._speak(turn, shown_s)
            self.side.turn(shown_s)
            if self.faulty.scene is not None:
                happened.note(now_s - began, self.side, plant, scrapes)
            turn += 1
        return happened

    def _speak(self, turn: int, now_s: float) -> None:
        """Tell the safety side what the game's side would: orders, and the driver's decision."""
        fails, box = self.faulty.scene is not None, self.side.boxes.words
        orders: GivenOrders | None = self._orders
        control = self._decide()
        if fails:
            orders, control = self.fault.orders(self._orders), self.fault.control(control)
            if self.fault.silent:
                return
        heard = Word(self._orders, self._word.heard_s) if orders is None else Word(orders, now_s)
        self._word = replace(heard, control=control, decisions=turn)
        box.write(self._word.pack(), now_s)
        every = self.fault.damaged_every
        if fails and every and box.counter % every == 0:
            box.memory[(at := box.place_of(box.counter) + 20) : at + 1] = b"\xff"

    def _decide(self) -> Control:
        """Return what the driver does, by what the kart reports."""
        report, scene = self.side.boxes.report(), self.faulty.scene
        waits = self.fault.standing and (scene is None or scene.since_s < WAITS_S)
        if waits or report is None or report.pose is None:
            return Control(brake=1.0)
        pose = report.pose
        told = Body(self.vehicle, pose.x, pose.y, pose.heading, pose.speed)
        command = self._driver.act(told)
        return Control(command.steering, command.throttle, command.brake)
