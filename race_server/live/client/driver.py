"""A driver's process: takes a seat, answers every observation, comes back if the link breaks."""

import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TypeVar

from race_server.core.clock import TICK_S, ticks_of
from race_server.core.driver import Briefing, Driver
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.errors import DriverError, LinkError, WireError
from race_server.live.client.latency_limiter import LatencyLimiter
from race_server.live.client.link_stats import LinkStats
from race_server.live.client.predictor import Predictor
from race_server.live.client.reconnect import FRESH_LINK_S, Reconnect
from race_server.live.client.seat import SILENCE_S, ClientSeat, insist, take_seat
from race_server.net.auth.keys import ClientKeys
from race_server.net.transport import DEFAULT_ADDRESS, ClientLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import Join
from race_server.net.wire.spectate import decode_events

Answer = TypeVar("Answer")

# For so long a driver tries to get its seat back after the link broke.
RETRY_S = 30.0
# For so long it waits to be told how the race has ended for it.
OUTCOME_S = 1.0


def run_driver(
    driver: Driver,
    name: str,
    *,
    address: str = DEFAULT_ADDRESS,
    session: str = "race",
    wanted: int = -1,
    timeout_s: float = 20.0,
    keys: ClientKeys | None = None,
    link_stats: LinkStats | None = None,
    tell: Callable[[LinkStats], None] = lambda _: None,
    raw: bool = False,
) -> Briefing:
    """Drive one race to its end and return the briefing that the driver had.

    raw: the driver sees what came as it came, however old it is, and drives as it likes; else a
    slow network is allowed for, see `predictor` and `latency_limiter` beside this file.
    reception: takes what is heard; tell: is called with it after each observation.

    Raises:
        LinkError: no server, it did not come back, or it does not let us in.
        SeatError: no seat.
        DriverError: the driver raised; its seat is left.
    """
    connect = partial(ClientLink, address, session, keys=keys)
    with connect(timeout_s=timeout_s) as link:
        persist = partial(insist, deadline=time.monotonic() + timeout_s)
        seat = persist(partial(take_seat, link, Join(name[:32], driver.preset, wanted)))
        _call(name, "reset", partial(driver.reset, seat.welcome.briefing))
        heard = link_stats or LinkStats()
        if link_stats is not None:
            _listen(link, seat.number, link_stats)
        catch_up = partial(_catch_up, seat.number, heard)
        with Reconnect(seat, partial(connect, timeout_s=FRESH_LINK_S), catch_up) as renewal:
            try:
                persist(partial(_get_ready, seat, heard))
                _answer(driver, name, seat, renewal, heard, tell, raw=raw)
            except DriverError:
                seat.act(topics.LEAVE)
                raise
        return seat.welcome.briefing


def _get_ready(seat: ClientSeat, link_stats: LinkStats) -> None:
    begun = time.monotonic()
    seat.act(topics.READY)
    link_stats.offset.note_round_trip(time.monotonic() - begun)


def _listen(link: ClientLink, seat: int, link_stats: LinkStats) -> Callable[[bytes], None]:
    """Let somebody take note of the events of a race; return what takes them."""

    def hear_events(data: bytes) -> None:
        with suppress(WireError):
            link_stats.note_events(*decode_events(data), seat)

    link.listen(topics.EVENTS, hear_events)
    link_stats.hears_events = True
    return hear_events


def _catch_up(seat: int, link_stats: LinkStats, link: ClientLink, deadline: float) -> None:
    """Listen on a fresh link too, and ask for what the old one owes."""
    if link_stats.hears_events:
        _listen(link, seat, link_stats)(insist(partial(link.ask, topics.RECENT), deadline))


def _answer(
    driver: Driver,
    name: str,
    seat: ClientSeat,
    renewal: Reconnect,
    link_stats: LinkStats,
    tell: Callable[[LinkStats], None],
    *,
    raw: bool,
) -> None:
    """Answer observations until the race is over for this kart."""
    briefing = seat.welcome.briefing
    decision_ticks = max(ticks_of(briefing.decision_s), 1)
    caution = LatencyLimiter(briefing.vehicle)
    predictor = Predictor(briefing.vehicle, briefing.lidar_field)
    sequence = 0
    epoch = answered = -1
    last = time.monotonic()
    while True:
        frame = seat.hear(SILENCE_S)
        link_stats.reconnects += renewal.end()
        if frame is None:
            if time.monotonic() - last > RETRY_S:
                raise LinkError(f"no observation for {RETRY_S:g} s: the server has gone")
            if epoch >= 0 and renewal.begin():
                continue
            with suppress(LinkError):  # a lobby that has not started yet has nothing to tell
                seat.come_back()
                link_stats.reconnects += epoch >= 0
            continue
        last = time.monotonic()
        if frame.epoch == epoch and frame.tick < answered:
            continue  # late, from a link that was given up
        if frame.epoch != epoch:
            epoch, sequence, answered = frame.epoch, frame.acknowledged, -1
            link_stats.begin()
        link_stats.note(frame.tick, last, decision_ticks)
        if not raw and link_stats.is_in_real_time():
            caution.note(link_stats.last_age_s, link_stats.last_gap_s)
        tell(link_stats)
        if frame.tick != answered:  # the same tick again: our answer was lost, not unwanted
            answered = frame.tick
            observation = Observation(frame.tick, seat.layout, frame.values)
            shown = observation
            if caution.is_needed:
                age_s = link_stats.offset.age_s(frame.tick * TICK_S, last)
                shown = predictor.ahead(observation, last, age_s, caution.late_s)
            control = _call(name, "act", partial(driver.act, shown))
            control = caution.temper(control, shown.scalar("speed"))
        predictor.note(time.monotonic(), control)
        sequence += 1
        seat.answer(frame.epoch, sequence, frame.tick, control)
        if observation.scalar("finished") > 0.0:
            link_stats.wait_for_outcome(OUTCOME_S)
            return


def _call(name: str, what: str, function: Callable[[], Answer]) -> Answer:
    try:
        return function()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise DriverError(f"driver {name!r} failed in {what}: {reason}") from error


class KartClient:
    """A driver of one's own: override `act`, then call `run`.

    >>> class Careful(KartClient):
    ...     preset = "lidar"
    ...     def act(self, observation):
    ...         return Control(throttle=0.2)
    >>> Careful().run("tcp/127.0.0.1:7447")  # doctest: +SKIP
    """

    preset = "lidar"
    briefing: Briefing

    def reset(self, briefing: Briefing) -> None:
        """Keep the briefing; override to prepare more."""
        self.briefing = briefing

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        raise DriverError(f"{type(self).__name__} does not say how to act: override `act`")

    def run(self, address: str = DEFAULT_ADDRESS, *, session: str = "race", name: str = "") -> None:
        """Drive one race on the server at `address`."""
        run_driver(self, name or type(self).__name__, address=address, session=session)
