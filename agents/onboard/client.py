"""The program of a real kart: takes a seat, reports poses, applies controls, keeps the kart safe.

`KartProgram` is the kart's end of the link; `ControlUnit` decides. The kart's body, a real one or
the plant, is a `Hardware`. Nothing in the control loop waits for the network.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

from race_agents.onboard.crew import Crew
from race_agents.onboard.grounds import fence_of
from race_agents.onboard.parker import PRESET, Parker
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.readings import Readings
from race_agents.unit.safety import Command
from race_server.core.clock import Pacer
from race_server.core.driver import Briefing, Driver, ParkingDriver, driver_named
from race_server.core.messages import Control, Flag, Trust
from race_server.core.observation import Observation
from race_server.errors import LinkError, RaceError, WireError
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.net.auth.keys import ClientKeys
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.drive import HudFrame, decode_hud
from race_server.net.wire.lobby import CourseSheet, Join, Welcome, decode_course
from race_server.net.wire.parking import OrderFrame
from race_server.net.wire.pose import PoseFrame, encode_pose

PERIOD_S = 0.02  # the control unit decides, and a pose goes out, 50 times a second
# After the link broke the kart asks for its seat as often as this, and gives up after this time.
RETRY_S, GIVE_UP_S = 1.0, 10.0
# Between two races of an event it gives up after this time without an answer.
AWAY_S = 60.0
# The driver that parks, where none is named.
VALET = "valet"

Clock = Callable[[], float]


class Hardware(Protocol):
    """A kart's body: sensors, actuators, and who holds the wheel."""

    def read(self, now_s: float) -> Readings:
        """Return what the sensors give now."""

    def act(self, command: Command) -> None:
        """Move the actuators."""

    def hands(self, control: Control | None, now_s: float) -> Control | None:
        """Return what comes from wheel and pedals now, if anything new does.

        control: what the driver decided on, None if it has seen nothing new.
        """


@dataclass
class KartProgram:
    """A seat as a real kart holds it."""

    seat: ClientSeat
    clock: Clock
    delay_s: float = 0.0  # added each way, to play a slow link
    is_cut: bool = False  # as if the radio were off
    sequence: int = 0
    _up: deque[tuple[float, bytes]] = field(default_factory=deque)
    _down: deque[tuple[float, bytes]] = field(default_factory=lambda: deque(maxlen=64))
    _asking: threading.Thread | None = None

    def store(self, data: bytes) -> None:
        """Take a message from the server; called by the transport's thread."""
        self._down.append((self.clock() + self.delay_s, data))

    def hear(self, now_s: float) -> tuple[HudFrame, float] | None:
        """Return the newest heads-up data that has arrived, and when it did."""
        newest = None
        while self._down and self._down[0][0] <= now_s:
            newest = self._down.popleft()
        if newest is None or self.is_cut:
            return None
        try:
            return decode_hud(newest[1]), newest[0]
        except WireError:
            return None  # the next one comes in 50 ms

    def see(self) -> Observation | None:
        """Return what the driver sees: the newest observation, if there is a new one."""
        frame = self.seat.receive(0.0)
        if frame is None or self.is_cut:
            return None
        return Observation(frame.tick, self.seat.layout, frame.values)

    def receive_order(self) -> OrderFrame | None:
        """Return the newest order to park, if one has arrived."""
        return None if self.is_cut else self.seat.receive_order()

    def tell(self, unit: ControlUnit, now_s: float) -> None:
        """Send the pose, and what was sent before and is due."""
        pose, hud = unit.pose(), unit.hud
        if pose is not None and hud is not None:
            self.sequence += 1
            told = PoseFrame(
                epoch=hud.epoch,
                sequence=self.sequence,
                acknowledged=hud.sequence,
                pose=replace(pose, echo_us=unit.echo_us(now_s)),
                buttons=unit.buttons,
            )
            self._up.append((now_s + self.delay_s, encode_pose(told)))
        while self._up and self._up[0][0] <= now_s:
            _, data = self._up.popleft()
            if not self.is_cut:
                self.seat.send(data)

    def ask_again(self) -> None:
        """Ask for the seat again after a silence; the kart stands meanwhile, by its reflex.

        A thread waits for the answer, which may take seconds: the reflex has none to spare.
        """
        if self._asking is None or not self._asking.is_alive():
            self._asking = threading.Thread(target=self._ask, name="seat")
            self._asking.start()

    def _ask(self) -> None:
        with suppress(RaceError):  # the next silence asks again
            self.seat.ask_again()

    def next_race(self, unit: ControlUnit) -> Welcome | None:
        """Wait for the next race of an event, which has begun then; None where there is none.

        unit: of the race before.

        Raises:
            LinkError: the server has gone.
        """
        epoch = unit.hud.epoch if unit.hud is not None else self.seat.welcome.epoch
        welcome, asked, answered = self.seat.welcome, -math.inf, self.clock()
        while welcome.stays:
            now = self.clock()
            if (heard := self.hear(now)) is not None and heard[0].epoch != epoch:
                self.seat.receive(0.0)  # the newest of the race before
                return welcome
            if now - asked > RETRY_S:
                asked = now
                with suppress(LinkError):
                    welcome = self.seat.ask_again()
                    if welcome.stays:
                        self.seat.act(topics.READY)
                    answered = self.clock()
            if now - answered > AWAY_S:
                raise LinkError(f"no answer for {AWAY_S:g} s: the server has gone")
            time.sleep(PERIOD_S)
        return None

    def close(self) -> None:
        """Wait for the answer that is on its way."""
        if self._asking is not None:
            self._asking.join()


def take_part(
    driver: Driver,
    hardware_of: Callable[[ClientSeat, CourseSheet, ClientLink], Hardware],
    *,
    name: str,
    address: str,
    session: str = "race",
    keys: ClientKeys | None = None,
    wanted: int = -1,
    timeout_s: float = 20.0,
    delay_s: float = 0.0,
    clock: Clock = time.monotonic,
    caution: float = 1.0,
    valet: str = VALET,
    on_request: bool = False,
    each_turn: Callable[[KartProgram, ControlUnit, float], bool] | None = None,
) -> None:
    """Drive one race with a real kart, all of an event, or park it.

    hardware_of: is called before each race, when the kart stands on its place on the grid. driver:
    one that parks goes to its slot in a car park; any other races, and hands the wheel to the one
    named by `valet` when the server orders the kart to park. caution: share of the tyres' grip
    that the driver's briefing states, because a real kart rarely has the grip of its data sheet.
    on_request: a driver that parks waits for an order of the server, too. each_turn: is called
    after each decision; the kart leaves once it returns False.

    Raises:
        LinkError: no server.
        SeatError: no seat.
        DriverError: the driver that is to park cannot.
    """
    with ClientLink(address, session, keys=keys, timeout_s=timeout_s) as link:
        persist = partial(insist, deadline=time.monotonic() + timeout_s)
        join = Join(name[:32], driver.preset, wanted, tracked=True)
        seat = persist(partial(take_seat, link, join))
        onboard = KartProgram(seat, clock, delay_s)
        link.listen(topics.HUD, onboard.store, seat.number)
        has_raced = False
        welcome: Welcome | None = seat.welcome
        while welcome is not None:
            sheet = decode_course(persist(partial(link.ask, topics.COURSE)))
            vehicle = welcome.briefing.vehicle
            unit = ControlUnit.of(vehicle, fence_of(sheet))
            hardware = hardware_of(seat, sheet, link)
            known = replace(vehicle, grip=caution * vehicle.grip)
            briefing = replace(welcome.briefing, vehicle=known)
            crew = _crew_of(driver, name, valet, briefing, welcome, sheet)
            if crew.parker is not None and not on_request:
                crew.parker.take(welcome.order)
            if not has_raced:
                persist(partial(seat.act, topics.READY))
            _drive(crew, onboard, unit, hardware, each_turn or _until_home)
            has_raced, welcome = True, onboard.next_race(unit)
            persist = partial(insist, deadline=time.monotonic() + timeout_s)


def _crew_of(
    driver: Driver, name: str, valet: str, briefing: Briefing, welcome: Welcome, sheet: CourseSheet
) -> Crew:
    """Return the drivers, each with its briefing."""
    races_first = len(sheet.line) > 0
    if isinstance(driver, ParkingDriver) and driver.preset == PRESET:
        return Crew(None, Parker(driver, name, briefing, welcome.lidar_rays), races_first)
    driver.reset(briefing)
    if races_first and not len(sheet.slots):
        return Crew(driver)
    parker = Parker(driver_named(valet), valet, briefing, welcome.lidar_rays)
    return Crew(driver, parker, races_first)


def _until_home(onboard: KartProgram, unit: ControlUnit, now_s: float) -> bool:
    """Go on until the race is over for this kart and it stands."""
    del onboard, now_s
    return not is_home(unit)


def is_home(unit: ControlUnit) -> bool:
    """Return whether the kart was ordered to stop after the start, and stands."""
    hud = unit.hud
    if hud is None or hud.trust is Trust.SUSPENDED or hud.flag is Flag.RED:
        return False
    told = hud.lights_s == 0.0 and hud.speed_cap == 0.0
    return told and unit.fusion is not None and abs(unit.fusion.state[3]) < 0.05


def _drive(
    crew: Crew,
    onboard: KartProgram,
    unit: ControlUnit,
    hardware: Hardware,
    goes_on: Callable[[KartProgram, ControlUnit, float], bool],
) -> None:
    """Turn 50 times a second; however the loop ends, the kart is left with its brakes on."""
    try:
        _turn(crew, onboard, unit, hardware, goes_on)
    finally:
        hardware.act(Command())
        crew.close()
        onboard.close()


def _turn(
    crew: Crew,
    onboard: KartProgram,
    unit: ControlUnit,
    hardware: Hardware,
    goes_on: Callable[[KartProgram, ControlUnit, float], bool],
) -> None:
    pacer = Pacer(PERIOD_S)
    pacer.start()
    heard_s = asked = onboard.clock()
    while unit.hud is None or onboard.clock() - heard_s < GIVE_UP_S:
        now = onboard.clock()
        unit.sense(hardware.read(now))
        if (heard := onboard.hear(now)) is not None:
            unit.hear(*heard)
            heard_s = asked = now
        decided = crew.act(onboard.see(), onboard.receive_order(), unit, now)
        control = hardware.hands(decided, now)
        if control is not None:
            unit.drive(control, now)
        hardware.act(unit.decide(now))
        onboard.tell(unit, now)
        if not goes_on(onboard, unit, now):
            return
        if now - asked > RETRY_S and not onboard.is_cut and unit.hud is not None:
            asked = now
            onboard.ask_again()
        pacer.wait()
