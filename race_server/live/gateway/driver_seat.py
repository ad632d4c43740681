"""A seat that is driven from a browser: held here, so that a page may disconnect and resume."""

import asyncio
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import Protocol, TypeVar

from race_server.errors import (
    GatewayError,
    KeysError,
    LinkError,
    RaceError,
    SeatError,
    WireError,
)
from race_server.live.client.seat import ClientSeat, take_seat
from race_server.live.gateway.audience import HINT, HUD, Outbox
from race_server.live.gateway.frames import frame_of, notice_frame
from race_server.live.gateway.limits import GatewayTiming
from race_server.live.gateway.live import Moment
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.drive import decode_control, decode_hud
from race_server.net.wire.hint import decode_hint
from race_server.net.wire.lobby import Join, encode_welcome

Answer = TypeVar("Answer")

# An observation that needs no sensor to be simulated: the gateway does not use it.
PRESET = "track"
DEAD_MAN = "no control for a quarter of a second: the kart coasts, then brakes"


class DriverConnection(Protocol):
    """The connection of a browser that drives."""

    outbox: Outbox
    received_at: float  # of the newest message, by `time.monotonic`

    def disconnect(self, error: GatewayError) -> None:
        """End, with a reason."""


class DriverSeat:
    """What one drive token opens: a seat, once it is taken, and the browser that drives it."""

    def __init__(
        self,
        number: int,
        connect: Callable[[int], ClientLink],
        seats: Callable[[int], Iterable[int]],
        pool: Executor,
        timing: GatewayTiming,
    ) -> None:
        """Hold no seat yet.

        number: of the token; connect: returns a link for a seat; seats: returns those to try for
        the one that is wanted; pool: for blocking work.
        """
        self.number = number
        self._connect, self._seats, self._pool = connect, seats, pool
        self._timing = timing
        self._loop = asyncio.get_running_loop()
        self.driver: DriverConnection | None = None
        self.seat: ClientSeat | None = None
        self.sequence = 0  # of the newest control that was sent; a browser counts on from it
        self._moment: tuple[int, int] | None = None  # epoch and tick of the newest heads-up data
        self._hud_at = self._control_at = self._left_at = 0.0
        self._is_dead = True
        self._accepted: dict[topics.Topic, tuple[bool, Moment]] = {}  # of what was asked for
        self._request: asyncio.Task[None] | None = None
        self._joining = asyncio.Lock()  # one seat is asked for at a time

    @property
    def number_of_seat(self) -> int:
        """The number of its seat, -1 where it holds none."""
        return -1 if self.seat is None else self.seat.number

    # Claim, resume, release

    async def claim(self, driver: DriverConnection, name: str, wanted: int) -> bytes:
        """Give the seat to a browser, and return the briefing.

        Raises:
            GatewayError: another browser has it, or the race gives no seat.
        """
        if self.driver is not None:
            raise GatewayError(
                "used", "another browser drives with this token; ask the organiser for your own"
            )
        self.driver = driver
        try:
            seat = await self._hold_seat(name, wanted)
        except BaseException as error:
            self.release(driver)
            if isinstance(error, RaceError):
                raise _refusal(error) from error
            raise
        if self.driver is not driver:
            raise _displaced()
        return self._begin(seat)

    async def _hold_seat(self, name: str, wanted: int) -> ClientSeat:
        """Return the seat that is held; without one, join the race."""
        async with self._joining:
            if self.seat is None:
                self.seat = await self._run_in_pool(partial(self._join, name, wanted))
                self._hud_at = time.monotonic()
            return self.seat

    def resume(self, driver: DriverConnection) -> bytes | None:
        """Give the seat to a browser with a resume token; None where no seat is held.

        Raises:
            GatewayError: the browser before it is still there and sends.
        """
        before = self.driver
        if before is not None:
            if time.monotonic() - before.received_at < self._timing.stalled_s:
                raise GatewayError("used", "this driver is here already and drives")
            before.disconnect(_displaced())
        if self.seat is None:
            self.driver = None
            return None
        self.driver = driver
        return self._begin(self.seat)

    def _begin(self, seat: ClientSeat) -> bytes:
        self._is_dead = True
        # The secret by which the server knows this seat stays in the gateway.
        return encode_welcome(replace(seat.welcome, secret=0))

    def release(self, driver: DriverConnection) -> None:
        """Record that a browser has gone; its seat is kept for a while."""
        if self.driver is driver:
            self.driver, self._left_at = None, time.monotonic()

    def _join(self, name: str, wanted: int) -> ClientSeat:
        """Take the first free seat of those wanted; runs in the pool."""
        refused: SeatError | None = None
        for seat in self._seats(wanted):
            try:
                return self._try_seat(name or f"browser {self.number + 1}", seat)
            except SeatError as error:
                refused = error
        raise refused or SeatError("there is no seat")

    def _try_seat(self, name: str, wanted: int) -> ClientSeat:
        """Take a seat over a separate link."""
        link = self._connect(wanted)
        try:
            seat = take_seat(link, Join(name, PRESET, wanted))
            for topic, publish in (
                (topics.HUD, self._publish_hud),
                (topics.COACH, self._publish_hint),
            ):
                link.listen(topic, partial(self._pass_on, publish), seat.number)
        except BaseException:
            link.close()
            raise
        return seat

    # Messages of the browser and of the server

    def send_control(self, data: bytes) -> None:
        """Send a control of the browser on, as the answer to the newest tick of the race.

        Raises:
            WireError: it is damaged, or too large.
        """
        frame = decode_control(data)
        if frame.sequence <= self.sequence:
            return  # late, or a copy
        self.sequence, self._control_at = frame.sequence, time.monotonic()
        if self._is_dead:
            self._is_dead = False
            self._notify("driving")
        if self.seat is not None and self._moment is not None:
            self.seat.answer(self._moment[0], self.sequence, self._moment[1], frame.control)

    async def ask(self, topic: topics.Topic, *, wanted: bool, moment: Moment) -> None:
        """Report to the server that this driver is ready, or wants its vehicle parked, or not.

        Raises:
            RaceError: the server refuses, or does not answer.
        """
        if self.seat is not None:
            await self._run_in_pool(partial(self.seat.act, topic, ready=wanted))
            self._accepted[topic] = wanted, moment

    def has_asked(self, topic: topics.Topic, moment: Moment) -> bool:
        """Return whether it holds what was asked for: readiness for one race is for no other."""
        return self._accepted.get(topic) == (True, moment)

    async def leave(self) -> None:
        """Give the seat up."""
        seat, self.seat, self._moment, self.sequence = self.seat, None, None, 0
        self._accepted.clear()
        if seat is not None:
            await self._run_in_pool(partial(_leave, seat))

    def _pass_on(self, publish: Callable[[bytes], None], data: bytes) -> None:
        """Pass a message to the event loop; called by a thread of zenoh."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(publish, data)

    def _publish_hud(self, data: bytes) -> None:
        hud = self._publish(HUD, decode_hud, data)
        if hud is not None:
            self._moment, self._hud_at = (hud.epoch, hud.tick), time.monotonic()

    def _publish_hint(self, data: bytes) -> None:
        self._publish(HINT, decode_hint, data)

    def _publish(self, kind: str, decode: Callable[[bytes], Answer], data: bytes) -> Answer | None:
        """Send the browser a message that is sound; return what it says."""
        try:
            told = decode(data)
        except WireError:
            return None
        if self.driver is not None:
            self.driver.outbox.send_newest(kind, frame_of(data))
        return told

    # Timeouts

    def poll(self) -> None:
        """Act on what has not happened in time; called about ten times a second."""
        now, timing = time.monotonic(), self._timing
        if not self._is_dead and now - self._control_at > timing.dead_man_s:
            self._is_dead = True
            self._notify("dead-man", DEAD_MAN)
        if self.seat is None or (self._request is not None and not self._request.done()):
            return
        if self.driver is None and now - self._left_at > timing.seat_grace_s:
            self._request = self._loop.create_task(self.leave())
        elif now - self._hud_at > timing.hud_timeout_s:
            self._hud_at = now
            self._request = self._loop.create_task(self._ask_again(self.seat))

    async def _ask_again(self, seat: ClientSeat) -> None:
        """Ask for a silent seat again: a lobby is silent, but so is a server that gave it away."""
        try:
            await self._run_in_pool(seat.ask_again)
        except SeatError as error:
            if self.seat is not seat:
                return  # given up meanwhile, and perhaps another one taken
            await self.leave()
            if self.driver is not None:
                self.driver.disconnect(GatewayError("seat-lost", f"the seat is lost: {error}"))
        except (LinkError, WireError):
            return  # all browsers are notified that there is no race

    def _notify(self, code: str, reason: str = "") -> None:
        if self.driver is not None:
            self.driver.outbox.send_frame(notice_frame(code, reason))

    async def _run_in_pool(self, work: Callable[[], Answer]) -> Answer:
        return await self._loop.run_in_executor(self._pool, work)


def _leave(seat: ClientSeat) -> None:
    """Leave a seat and close its link; runs in the pool."""
    with seat.link:
        try:
            seat.act(topics.LEAVE)
        except RaceError:
            return  # the server has given the seat away already


def _displaced() -> GatewayError:
    return GatewayError("used", "this driver has come back with another browser")


def _refusal(error: RaceError) -> GatewayError:
    if isinstance(error, SeatError):
        return GatewayError("seat-taken", str(error))
    if isinstance(error, KeysError):
        return GatewayError("token", str(error))
    return GatewayError("no-race", str(error))
