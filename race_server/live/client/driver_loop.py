"""What a driver's client does with each observation: without links, threads or a clock."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from race_server.core.clock import TICK_S, ticks_of
from race_server.core.driver import Briefing, Driver, ParkingDriver
from race_server.core.messages import Control
from race_server.core.observation import Layout, Observation
from race_server.errors import DriverError, LinkError
from race_server.live.client.latency_limiter import LatencyLimiter
from race_server.live.client.link_stats import LinkStats
from race_server.live.client.predictor import Predictor
from race_server.net.wire.drive import ObservationFrame
from race_server.net.wire.parking import OrderFrame

Result = TypeVar("Result")


@dataclass(frozen=True)
class Answer:
    """A control that answers the observation of a tick."""

    epoch: int
    sequence: int
    tick: int
    control: Control
    is_last: bool  # the race is over for this kart


class DriverLoop:
    """One driver in one race: observations in, answers out.

    The network is allowed for: observations that are lost, late or repeated, a race that begins
    again, and a link on which everything is old (see `predictor` and `latency_limiter`).
    """

    def __init__(
        self,
        driver: Driver,
        name: str,
        briefing: Briefing,
        layout: Layout,
        link_stats: LinkStats,
        *,
        give_up_s: float,
        now_s: float,
        raw: bool = False,
    ) -> None:
        """Begin before the first observation.

        driver: was reset already. give_up_s: without an observation for this long the server has
        gone. now_s: by the clock of all later calls. raw: give the driver what was received as it
        was received, and send what it answers, however old that is.
        """
        self._driver, self._name, self._layout = driver, name, layout
        self._link_stats, self._raw = link_stats, raw
        self._give_up_s, self._last_s = give_up_s, now_s
        self._decision_ticks = max(ticks_of(briefing.decision_s), 1)
        self._limiter = LatencyLimiter(briefing.vehicle)
        self._predictor = Predictor(briefing.vehicle, briefing.lidar_field)
        self._epoch = self._answered = -1  # the tick that was answered last
        self._sequence = 0
        self._control = Control()
        self._order: OrderFrame | None = None  # the newest, and that of the round
        self._first_order: OrderFrame | None = None

    def on_order(self, frame: OrderFrame | None) -> None:
        """Hand an order to park to the driver, if there is a new one and the driver takes orders.

        Raises:
            DriverError: the driver raised.
        """
        if frame is None or (self._order and _number_of(frame) <= _number_of(self._order)):
            return
        self._order = frame
        self._first_order = self._first_order or frame
        if isinstance(driver := self._driver, ParkingDriver):
            call_driver(self._name, "park", lambda: driver.park(frame.order))

    @property
    def has_begun(self) -> bool:
        """Whether an observation was received yet; a lobby sends none."""
        return self._epoch >= 0

    def on_sign(self, now_s: float) -> None:
        """Record that the server is there, though it sends no observation of a new race."""
        self._last_s = now_s

    def on_silence(self, now_s: float) -> None:
        """Do nothing as long as it is worth waiting.

        Raises:
            LinkError: there was no observation for too long.
        """
        if now_s - self._last_s > self._give_up_s:
            raise LinkError(f"no observation for {self._give_up_s:g} s: the server has gone")

    def on_frame(self, frame: ObservationFrame, now_s: float) -> Answer | None:
        """Return the answer to an observation, None where it is older than one answered already.

        Raises:
            DriverError: the driver raised.
        """
        self._last_s = now_s
        if frame.epoch == self._epoch and frame.tick < self._answered:
            return None  # late, from a link that was given up
        if frame.epoch != self._epoch:
            if self.has_begun and self._first_order:  # the same round again
                self.on_order(replace(self._first_order, epoch=frame.epoch))
            self._epoch, self._sequence, self._answered = frame.epoch, frame.acknowledged, -1
            self._link_stats.begin()
        self._record(frame.tick, now_s)
        observation = Observation(frame.tick, self._layout, frame.values)
        if frame.tick != self._answered:
            self._answered = frame.tick
            self._control = self._decide(observation, now_s)
        # Else the same tick again: the answer was lost, so it is sent again.
        self._sequence += 1
        is_last = observation.scalar("finished") > 0.0
        return Answer(self._epoch, self._sequence, frame.tick, self._control, is_last)

    def on_sent(self, answer: Answer, now_s: float) -> None:
        """Record that an answer is sent now; later observations are predicted from it."""
        self._predictor.record(now_s, answer.control)

    def _record(self, tick: int, now_s: float) -> None:
        stats = self._link_stats
        stats.record_observation(tick, now_s, self._decision_ticks)
        if not self._raw and stats.is_in_real_time():
            self._limiter.record(stats.last_age_s, stats.last_gap_s)

    def _decide(self, observation: Observation, now_s: float) -> Control:
        """Return what the driver answers, within what the network allows."""
        shown = observation
        if self._limiter.is_needed:
            age_s = self._link_stats.offset.age_s(observation.tick * TICK_S, now_s)
            shown = self._predictor.ahead(observation, now_s, age_s, self._limiter.late_s)
        control = call_driver(self._name, "act", lambda: self._driver.act(shown))
        return self._limiter.limit(control, shown.scalar("speed"))


def _number_of(frame: OrderFrame) -> tuple[int, int]:
    return frame.epoch, frame.sequence


def call_driver(name: str, what: str, function: Callable[[], Result]) -> Result:
    """Return what a method of a driver returns.

    Raises:
        DriverError: it raised.
    """
    try:
        return function()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise DriverError(f"driver {name!r} failed in {what}: {reason}") from error
