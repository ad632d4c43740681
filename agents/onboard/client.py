"""The program of a real kart: takes a seat, reports poses, applies controls, keeps the kart safe.

This is the game's side: link, driver, report. `KartProgram` is the kart's end of the link. What
moves and keeps safe is the other side, `race_agents.onboard.safety_side`, in a separate process.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field, replace
from functools import partial

from race_agents.onboard.beside import Beside
from race_agents.onboard.crew import Crew
from race_agents.onboard.kart import Kart
from race_agents.onboard.parker import PRESET, Parker
from race_agents.onboard.peers import Peers
from race_agents.unit.records import Floats, Report, Word
from race_server.core.alert import Alert, DangerStage
from race_server.core.clock import MICROSECONDS, Pacer
from race_server.core.driver import Briefing, Driver, ParkingDriver, driver_named
from race_server.core.messages import Peer, Pose
from race_server.core.observation import Observation
from race_server.core.telemetry import Telemetry
from race_server.core.vehicles import Vehicle
from race_server.errors import LinkError, RaceError, WireError
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.net.auth.keys import ClientKeys
from race_server.net.auth.settings import PeerSettings
from race_server.net.transport import ClientLink, PeerLink
from race_server.net.wire import topics
from race_server.net.wire.alert import AlertFrame, encode_alert
from race_server.net.wire.drive import HudFrame, decode_hud
from race_server.net.wire.lobby import CourseSheet, Join, Welcome, decode_course
from race_server.net.wire.parking import OrderFrame
from race_server.net.wire.pose import PoseFrame, encode_pose
from race_server.net.wire.telemetry import TelemetryFrame, encode_telemetry

PERIOD_S = 0.02  # a driver is asked, and a pose goes out, 50 times a second
# After the link broke the kart asks for its seat as often as this, and gives up after this time.
RETRY_S, GIVE_UP_S = 1.0, 10.0
# What a kart says is said again as often as this, for as long as it lasts.
SAY_AGAIN_S = 0.2
# How it is it tells this often, and at once when a sensor fails.
TELEMETRY_S = 0.2
# Between two races of an event it gives up after this time without an answer.
AWAY_S = 60.0
# The driver that parks, where none is named.
VALET = "valet"


Clock = Callable[[], float]
Send = Callable[[bytes], None]


@dataclass
class KnownKart:
    """What the game's side knows of its kart."""

    vehicle: Vehicle
    hud: HudFrame | None = None
    hud_s: float = 0.0  # when it came
    report: Report = field(default_factory=Report)

    def pose(self) -> Pose | None:
        """Return where the kart says that it is."""
        return self.report.pose

    @property
    def ranges(self) -> Floats | None:
        """What its lidar sees [m], None where it has none."""
        return self.report.ranges

    def echo_us(self, now_s: float) -> int:
        """Return the server's clock as the newest message had it, and the time since [µs]."""
        if self.hud is None:
            return 0
        return self.hud.monotonic_us + round((now_s - self.hud_s) * MICROSECONDS)


@dataclass
class KartProgram:
    """A seat as a real kart holds it."""

    seat: ClientSeat
    clock: Clock
    delay_s: float = 0.0  # added each way, to play a slow link
    is_cut: bool = False  # as if the radio were off
    sequence: int = 0
    alerts: int = 0  # sent so far
    beside: Beside | None = None  # told what the kart knows, whether the radio works or not
    peers: Peers | None = None  # the other real karts
    _up: deque[tuple[float, Send, bytes]] = field(default_factory=deque)
    _down: deque[tuple[float, bytes]] = field(default_factory=lambda: deque(maxlen=64))
    _asking: threading.Thread | None = None
    _stamp_us: int = -1  # of the newest pose that was sent
    _said: Alert | None = None
    _said_s: float = -math.inf
    _told: Telemetry | None = None
    _told_s: float = -math.inf
    _reports: int = 0  # of telemetry sent so far

    def __post_init__(self) -> None:
        """Get ready to send alerts and telemetry beside poses."""
        self._send_alert = self.seat.sender(topics.ALERT)
        self._send_telemetry = self.seat.sender(topics.TELEMETRY)

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

    def hear_peers(self, kart: KnownKart, now_s: float) -> tuple[Peer, ...]:
        """Return what the other real karts tell."""
        if self.peers is None or self.is_cut or kart.hud is None:
            return ()
        return self.peers.hear(kart.hud.epoch, kart.pose(), now_s)

    def see(self) -> Observation | None:
        """Return what the driver sees: the newest observation, if there is a new one."""
        frame = self.seat.receive(0.0)
        if frame is None or self.is_cut:
            return None
        return Observation(frame.tick, self.seat.layout, frame.values)

    def receive_order(self) -> OrderFrame | None:
        """Return the newest order to park, if one has arrived."""
        return None if self.is_cut else self.seat.receive_order()

    def tell(self, kart: KnownKart, now_s: float) -> None:
        """Send the pose, what the kart has to say, and what was sent before and is due."""
        pose, hud = kart.pose(), kart.hud
        if self.beside is not None:
            self.beside.tell(kart.report)
        if hud is not None:
            self._say(kart.report.alert, hud.epoch, now_s)
            self._tell_health(kart.report, hud.epoch, now_s)
        if pose is not None and hud is not None and pose.stamp_us != self._stamp_us:
            self.sequence, self._stamp_us = self.sequence + 1, pose.stamp_us
            if self.peers is not None and not self.is_cut:
                self.peers.tell(kart.report, kart.vehicle, hud.epoch, now_s)
            told = PoseFrame(
                epoch=hud.epoch,
                sequence=self.sequence,
                acknowledged=hud.sequence,
                pose=replace(pose, echo_us=kart.echo_us(now_s)),
                buttons=kart.report.buttons,
            )
            self._up.append((now_s + self.delay_s, self.seat.send, encode_pose(told)))
        while self._up and self._up[0][0] <= now_s:
            _, send, data = self._up.popleft()
            if not self.is_cut:
                send(data)

    def _tell_health(self, report: Report, epoch: int, now_s: float) -> None:
        """Send how the kart is five times a second, and when a sensor changes."""
        told = Telemetry.of(report.pose, report.alert, report.health)
        is_new = self._told is None or told.health.sensors != self._told.health.sensors
        if not is_new and now_s - self._told_s < TELEMETRY_S:
            return
        self._told, self._told_s, self._reports = told, now_s, self._reports + 1
        data = encode_telemetry(TelemetryFrame(epoch, self._reports, told))
        self._up.append((now_s + self.delay_s, self._send_telemetry, data))

    def _say(self, alert: Alert, epoch: int, now_s: float) -> None:
        """Send an alert if it says something new, and again for as long as it lasts."""
        is_new = self._said is None or alert.gist != self._said.gist
        lasts = alert.danger.stage > DangerStage.NONE and now_s - self._said_s > SAY_AGAIN_S
        if not is_new and not lasts:
            return
        self._said, self._said_s = alert, now_s
        self.alerts += 1
        data = encode_alert(AlertFrame(epoch, self.alerts, alert))
        self._up.append((now_s + self.delay_s, self._send_alert, data))

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

    def next_race(self, last: HudFrame | None) -> Welcome | None:
        """Wait for the next race of an event, which has begun then; None where there is none.

        last: heard in the race before, None before the first one.

        Raises:
            LinkError: the server has gone.
        """
        welcome, asked, answered = self.seat.welcome, -math.inf, self.clock()
        while welcome.stays:
            now = self.clock()
            heard = self.hear(now)
            if heard is not None and (last is None or heard[0].epoch != last.epoch):
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
    kart_of: Callable[[ClientSeat, CourseSheet, ClientLink], Kart],
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
    beside: str = "",
    peers: tuple[str, ...] = (),
    each_turn: Callable[[KartProgram, Kart, float], bool] = lambda *_: True,
) -> None:
    """Drive one race with a real kart, all of an event, or park it.

    kart_of: is called before each race, when the kart stands on its place on the grid; in an event,
    where each race has an order of its own, once the race counts down. driver: one that parks goes
    to its slot in a car park; any other races, and hands the wheel to the one named by `valet` when
    the server orders the kart to park. caution: share of the tyres' grip that the driver's briefing
    states, because a real kart rarely has the grip of its data sheet. on_request: a driver that
    parks waits for an order of the server, too. beside: address of this machine at which programs
    are told what the kart knows, "" for none. each_turn: is called after each turn of the game's
    side; the kart leaves once it returns False, or once its safety side has nothing more to do.

    Raises:
        LinkError: no server.
        SeatError: no seat.
        DriverError: the driver that is to park cannot.
    """
    with ExitStack() as left:
        link = left.enter_context(ClientLink(address, session, keys=keys, timeout_s=timeout_s))
        persist = partial(insist, deadline=time.monotonic() + timeout_s)
        join = Join(name[:32], driver.preset, wanted, tracked=True)
        seat = persist(partial(take_seat, link, join))
        onboard = KartProgram(seat, clock, delay_s)
        if beside:
            onboard.beside = left.enter_context(closing(Beside(beside, session, seat.number)))
        if peers:
            onboard.peers = left.enter_context(closing(Peers(seat.number)))
            meet = PeerSettings(peers[0], peers[1:], session, seat.number, keys)
            heard = onboard.peers
            heard.radio = PeerLink(meet, lambda number, data: heard.store(number, data, clock()))
        link.listen(topics.HUD, onboard.store, seat.number)
        welcome = onboard.next_race(None) if seat.welcome.stays else seat.welcome
        while welcome is not None:
            persist = partial(insist, deadline=time.monotonic() + timeout_s)
            sheet = decode_course(persist(partial(link.ask, topics.COURSE)))
            vehicle = welcome.briefing.vehicle
            kart, known = kart_of(seat, sheet, link), KnownKart(vehicle)
            stated = replace(vehicle, grip=caution * vehicle.grip)
            briefing = replace(welcome.briefing, vehicle=stated)
            crew = _crew_of(driver, name, valet, briefing, welcome, sheet)
            if crew.parker is not None and not on_request:
                crew.parker.take(welcome.order)
            if not welcome.stays:
                persist(partial(seat.act, topics.READY))
            _drive(crew, onboard, kart, known, each_turn)
            welcome = onboard.next_race(known.hud)


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


def _drive(
    crew: Crew,
    onboard: KartProgram,
    kart: Kart,
    known: KnownKart,
    goes_on: Callable[[KartProgram, Kart, float], bool],
) -> None:
    """Turn 50 times a second; however the loop ends, the kart is left with its brakes on."""
    try:
        _turn(crew, onboard, kart, known, goes_on)
    finally:
        kart.close()
        crew.close()
        onboard.close()


def _turn(
    crew: Crew,
    onboard: KartProgram,
    kart: Kart,
    known: KnownKart,
    goes_on: Callable[[KartProgram, Kart, float], bool],
) -> None:
    pacer, word = Pacer(PERIOD_S), Word()
    pacer.start()
    heard_s = asked = onboard.clock()
    while known.hud is None or onboard.clock() - heard_s < GIVE_UP_S:
        now = onboard.clock()
        if (heard := onboard.hear(now)) is not None:
            known.hud, known.hud_s = heard
            word = replace(word, orders=known.hud, heard_s=known.hud_s)
            heard_s = asked = now
        decided = crew.act(onboard.see(), onboard.receive_order(), known, now)
        if decided is not None:
            word = replace(word, control=decided, decisions=word.decisions + 1)
        word = replace(word, peers=onboard.hear_peers(known, now))
        kart.tell(word, now)
        kart.turn(now)
        if (report := kart.report()) is not None:
            known.report, onboard.is_cut = report, onboard.is_cut or report.is_cut
        onboard.tell(known, now)
        if known.report.is_through or not goes_on(onboard, kart, now):
            return
        if now - asked > RETRY_S and not onboard.is_cut and known.hud is not None:
            asked = now
            onboard.ask_again()
        pacer.wait()
