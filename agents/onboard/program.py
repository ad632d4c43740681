"""The kart's end of the link: what a real kart hears and tells while it has a seat."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

from race_agents.onboard.beside import Beside
from race_agents.onboard.peers import Peers
from race_agents.unit.records import Floats, Report
from race_server.core.alert import Alert, DangerStage
from race_server.core.clock import MICROSECONDS
from race_server.core.messages import Pose
from race_server.core.observation import Observation
from race_server.core.peer import Peer
from race_server.core.telemetry import Telemetry
from race_server.core.vehicles import Vehicle
from race_server.errors import LinkError, RaceError, WireError
from race_server.live.client.seat import ClientSeat
from race_server.net.wire import topics
from race_server.net.wire.alert import AlertFrame, encode_alert
from race_server.net.wire.drive import HudFrame, decode_hud
from race_server.net.wire.lobby import Welcome
from race_server.net.wire.parking import OrderFrame
from race_server.net.wire.pose import PoseFrame, encode_pose
from race_server.net.wire.telemetry import TelemetryFrame, encode_telemetry

PERIOD_S = 0.02  # a driver is asked, and a pose goes out, 50 times a second
# After the link broke the kart asks for its seat as often as this.
RETRY_S = 1.0
# What a kart says is said again as often as this, for as long as it lasts.
SAY_AGAIN_S = 0.2
# How it is it tells this often, and at once when a sensor fails.
TELEMETRY_S = 0.2
# Before a race begins, and between two of an event, it gives up after this time without an answer.
AWAY_S = 60.0

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
    answered_s: float = 0.0  # when the server last answered a request
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

    def ask_again(self, *, waits: bool) -> None:
        """Ask for the seat again after a silence; the kart stands meanwhile, by its reflex.

        A thread waits for the answer, which may take seconds: the reflex has none to spare. waits:
        for the race to begin. A server that was started again does not know that it is ready.
        """
        if self._asking is None or not self._asking.is_alive():
            self._asking = threading.Thread(target=self._ask, args=(waits,), name="seat")
            self._asking.start()

    def _ask(self, waits: bool) -> None:
        with suppress(RaceError):  # the next silence asks again
            self.seat.ask_again()
            self.answered_s = self.clock()
            if waits:
                self.seat.act(topics.READY)

    def expect_answers(self, now_s: float) -> None:
        """Check that the server has answered not long ago.

        Raises:
            LinkError: it has gone.
        """
        if now_s - self.answered_s > AWAY_S:
            raise LinkError(f"no answer for {AWAY_S:g} s: the server has gone")

    def next_race(self, last: HudFrame | None) -> Welcome | None:
        """Wait for the next race of an event, which has begun then; None where there is none.

        last: heard in the race before, None before the first one.

        Raises:
            LinkError: the server has gone.
        """
        welcome, asked, self.answered_s = self.seat.welcome, -math.inf, self.clock()
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
                    self.answered_s = self.clock()
            self.expect_answers(now)
            time.sleep(PERIOD_S)
        return None

    def close(self) -> None:
        """Wait for the answer that is on its way."""
        if self._asking is not None:
            self._asking.join()
