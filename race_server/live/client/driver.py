"""A driver's process: takes a seat, answers every observation, reconnects if the link breaks."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from race_server.core.driver import Briefing, Driver
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.errors import DriverError, LinkError, SeatError, WireError
from race_server.live.client.driver_loop import DriverLoop, call_driver
from race_server.live.client.link_stats import LinkStats
from race_server.live.client.reconnect import Reconnect
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.live.client.timing import ClientTiming
from race_server.net.auth.keys import ClientKeys
from race_server.net.transport import DEFAULT_ADDRESS, ClientLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import Join
from race_server.net.wire.spectate import decode_events
from race_server.net.wire.strict import MOST_NAME
from race_server.printable import fault_of_name


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
    on_observation: Callable[[LinkStats], None] = lambda _: None,
    raw: bool = False,
    timing: ClientTiming | None = None,
    on_turn: Callable[[], None] = lambda: None,
) -> Briefing:
    """Drive one race to its end, or all of an event, and return the briefing of the last.

    Args:
        driver: what decides.
        name: shown in the standings, at most 32 characters.
        address: of the server, such as ``tcp/127.0.0.1:7447``.
        session: the server's session.
        wanted: the seat, -1 for any.
        timeout_s: how long to wait for a server [s].
        keys: of a session with keys.
        link_stats: records what is received, and how the race ended for this driver.
        on_observation: is called with the link's figures after each observation.
        raw: give the driver what was received as it was received, and send what it answers,
            however old that is; else a slow network is allowed for, see `predictor` and
            `latency_limiter` beside this file.
        timing: timeouts during the race.
        on_turn: is called whenever the loop comes round, every few seconds at least.

    Raises:
        LinkError: no server, it did not come back, or it refuses the link.
        SeatError: no seat.
        DriverError: the driver raised; its seat is given up.
    """
    timing = timing or ClientTiming()
    connect = partial(ClientLink, address, session, keys=keys)
    with connect(timeout_s=timeout_s) as link:
        persist = partial(insist, deadline=time.monotonic() + timeout_s)
        seat = persist(partial(take_seat, link, Join(name[:MOST_NAME], driver.preset, wanted)))
        call_driver(name, "reset", partial(driver.reset, seat.welcome.briefing))
        stats = link_stats or LinkStats()
        if link_stats is not None:
            _record_events(link, seat.number, link_stats)
        catch_up = partial(_catch_up, seat.number, stats)
        fresh_link = partial(connect, timeout_s=timing.fresh_link_s)
        begin = partial(DriverLoop, driver, name, layout=seat.layout, link_stats=stats, raw=raw)
        begin = partial(begin, give_up_s=timing.give_up_s)
        with Reconnect(seat, fresh_link, catch_up, timing.fresh_link_s) as reconnect:
            try:
                persist(partial(_get_ready, seat, stats))
                races = _Races(seat, reconnect, stats, on_observation, timing, on_turn)
                return races.drive(driver, name, begin)
            except DriverError:
                seat.act(topics.LEAVE)
                raise


def checked_name(name: str) -> str:
    """Return a name that a person gave.

    Raises:
        SeatError: it is too long, or has a character that cannot be seen.
    """
    long = f"{len(name)} characters" if len(name) > MOST_NAME else ""
    if wrong := fault_of_name(name) or long:
        shown = name[:MOST_NAME]
        raise SeatError(f"name {shown!r} has {wrong}: use 1 to {MOST_NAME} printable characters")
    return name


def _get_ready(seat: ClientSeat, link_stats: LinkStats) -> None:
    begun = time.monotonic()
    seat.act(topics.READY)
    link_stats.offset.record_round_trip(time.monotonic() - begun)


def _record_events(link: ClientLink, seat: int, link_stats: LinkStats) -> Callable[[bytes], None]:
    """Record the events of a race as they arrive; return what records a message of them."""

    def receive(data: bytes) -> None:
        with suppress(WireError):
            link_stats.record_events(*decode_events(data), seat)

    link.listen(topics.EVENTS, receive)
    link_stats.receives_events = True
    return receive


def _catch_up(seat: int, link_stats: LinkStats, link: ClientLink, deadline: float) -> None:
    """Listen on a new link too, and ask for what the old one failed to deliver."""
    if link_stats.receives_events:
        receive = _record_events(link, seat, link_stats)
        receive(insist(partial(link.ask, topics.RECENT), deadline))


@dataclass
class _Races:
    """The races of one driver: one, or those of an event."""

    seat: ClientSeat
    reconnect: Reconnect
    link_stats: LinkStats
    on_observation: Callable[[LinkStats], None]
    timing: ClientTiming
    on_turn: Callable[[], None]
    epoch: int = -1  # of the last race that is over for this kart
    is_over: bool = False  # the event

    def drive(self, driver: Driver, name: str, begin: Callable[..., DriverLoop]) -> Briefing:
        """Drive all races, and return the briefing of the last; the driver was reset already.

        Raises:
            DriverError: the driver raised.
        """
        briefing = self.seat.welcome.briefing
        self._answer(begin(briefing=briefing, now_s=time.monotonic()))
        while (following := self._following()) is not None:
            briefing = following
            call_driver(name, "reset", partial(driver.reset, briefing))
            with suppress(LinkError):  # reported again below
                self.seat.act(topics.READY)
            self._answer(begin(briefing=briefing, now_s=time.monotonic()))
        return briefing

    def _answer(self, loop: DriverLoop) -> None:
        """Answer observations until the race is over for this kart, or the event is."""
        seat, link_stats = self.seat, self.link_stats
        loop.on_order(seat.welcome.order)
        while not self.is_over:
            self.on_turn()
            frame = seat.receive(self.timing.observation_timeout_s)
            link_stats.reconnects += self.reconnect.finish()
            now_s = time.monotonic()
            if frame is None:
                loop.on_silence(now_s)
                if loop.has_begun and self.reconnect.begin():
                    continue
                with suppress(LinkError):  # a lobby that has not started yet sends nothing
                    self._ask_again(loop)
                continue
            if frame.epoch == self.epoch:
                loop.on_sign(now_s)  # others still race
                continue
            loop.on_order(seat.receive_order())
            answer = loop.on_frame(frame, now_s)
            if answer is None:
                continue
            loop.on_sent(answer, time.monotonic())
            seat.answer(answer.epoch, answer.sequence, answer.tick, answer.control)
            self.on_observation(link_stats)
            if answer.is_last:
                link_stats.wait_for_outcome(self.timing.outcome_s)
                self.epoch = answer.epoch
                return

    def _ask_again(self, loop: DriverLoop) -> None:
        """Ask for the seat; between two races of an event report ready to a server that forgot."""
        welcome = self.seat.ask_again()
        self.link_stats.reconnects += loop.has_begun
        if loop.has_begun:
            return
        loop.on_sign(time.monotonic())
        if self.epoch >= 0:
            self.is_over = not welcome.stays
        if welcome.stays:
            self.seat.act(topics.READY)

    def _following(self) -> Briefing | None:
        """Return the briefing for the next race of an event, None where there is none."""
        if self.is_over or not self.seat.welcome.stays:
            return None
        welcome = insist(self.seat.ask_again, time.monotonic() + self.timing.give_up_s)
        return welcome.briefing if welcome.stays else None


class KartClient:
    """A driver on a server, in a few lines.

    Give it a function that returns a control for each observation:

    >>> from race_server.core.messages import Control
    >>> def act(observation):
    ...     left, right = observation["lidar"][100:].mean(), observation["lidar"][:101].mean()
    ...     return Control(steering=2.0 * (left - right) / (left + right), throttle=0.3)
    >>> KartClient(act, preset="lidar").run("tcp/127.0.0.1:7447")  # doctest: +SKIP

    or inherit from it and override `act`, and `reset` for what is needed before the race:

    >>> class Careful(KartClient):
    ...     preset = "lidar"
    ...     def act(self, observation):
    ...         return Control(throttle=0.2)
    >>> Careful().run("tcp/127.0.0.1:7447")  # doctest: +SKIP

    Attributes:
        preset: what the driver sees: ``lidar``, ``radar``, ``track``, ``line``, ``rivals`` or
            ``full``; `docs/observations.md` lists their parts.
        briefing: course, vehicle and rules, from `reset` on.
    """

    preset: str = "lidar"
    briefing: Briefing
    _act: Callable[[Observation], Control] | None = None

    def __init__(
        self,
        act: Callable[[Observation], Control] | None = None,
        *,
        preset: str | None = None,
    ) -> None:
        """Make a driver.

        act: returns a control for an observation; not needed where a class overrides `act`.
        preset: what the driver sees; without it that of the class.
        """
        self._act = act
        if preset is not None:
            self.preset = preset

    def reset(self, briefing: Briefing) -> None:
        """Keep the briefing; override to prepare more."""
        self.briefing = briefing

    def act(self, observation: Observation) -> Control:
        """Return the control that holds until the next observation.

        Raises:
            DriverError: there is no function, and the class does not override this method.
        """
        if self._act is None:
            raise DriverError(
                f"{type(self).__name__} does not say how to act: give a function, or override `act`"
            )
        return self._act(observation)

    def run(
        self,
        address: str = DEFAULT_ADDRESS,
        *,
        session: str = "race",
        name: str = "",
        seat: int = -1,
        keys: ClientKeys | None = None,
        timeout_s: float = 20.0,
        link_stats: LinkStats | None = None,
    ) -> None:
        """Drive one race on a server to its end.

        Args:
            address: of the server, such as ``tcp/127.0.0.1:7447``.
            session: the server's session.
            name: shown in the standings, at most 32 characters; without it the name of the class.
            seat: the seat wanted, -1 for any.
            keys: of a session with keys, see `read_client_keys`.
            timeout_s: how long to wait for a server [s].
            link_stats: records what is received, and how the race ended for this driver.

        Raises:
            LinkError: no server, it did not come back, or it refuses the link.
            SeatError: no seat, or the name is none.
            DriverError: `reset` or `act` raised; the seat is given up.
        """
        run_driver(
            self,
            checked_name(name) if name else type(self).__name__,
            address=address,
            session=session,
            wanted=seat,
            timeout_s=timeout_s,
            keys=keys,
            link_stats=link_stats,
        )
