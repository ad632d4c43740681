"""A seat that is driven from a browser: held here, so that a page can break off and come back."""

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
from race_server.live.client.seat import SILENCE_S, ClientSeat, take_seat
from race_server.live.gateway.audience import HUD
from race_server.live.gateway.connection import frame_of
from race_server.live.gateway.live import notice_frame
from race_server.live.gateway.outbox import Outbox
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.drive import decode_control, decode_hud
from race_server.net.wire.lobby import Join, encode_welcome

Answer = TypeVar("Answer")

# An observation for which no sensor has to be worked out: nobody looks at it.
PRESET = "track"
# Without a control for so long the driver's hand is off the wheel.
DEAD_MAN_S = 0.25
# A driver whose page has gone has so long to come back.
GRACE_S = 30.0
# While a page is heard nobody else takes its place with a word for coming back.
STALLED_S = 2.0
NO_HAND = "no control for a quarter of a second: the kart coasts, then brakes"


class DriverConnection(Protocol):
    """A browser at the wheel."""

    outbox: Outbox
    heard_at: float  # by `time.monotonic`

    def let_go(self, error: GatewayError) -> None:
        """End, with a reason."""


class DriverSeat:
    """What one drive token opens: a seat, once somebody has taken it, and who drives it."""

    def __init__(
        self,
        number: int,
        connect: Callable[[int], ClientLink],
        seats: Callable[[int], Iterable[int]],
        pool: Executor,
    ) -> None:
        """Hold no seat yet.

        connect: returns a link for a seat; seats: returns those to try for the one that is wanted;
        pool: for what has to wait.
        """
        self.number = number
        self._connect, self._seats, self._pool = connect, seats, pool
        self._loop = asyncio.get_running_loop()
        self.rider: DriverConnection | None = None
        self.seat: ClientSeat | None = None
        self.sequence = 0  # of the newest control that was sent; a browser counts on from it
        self._moment: tuple[int, int] | None = None  # epoch and tick of the newest heads-up data
        self._hud_at = self._control_at = self._left_at = 0.0
        self._is_dead = True
        self._asking: asyncio.Task[None] | None = None
        self._turn = asyncio.Lock()  # one seat is asked for at a time

    @property
    def number_of_seat(self) -> int:
        """The number of its seat, -1 where it holds none."""
        return -1 if self.seat is None else self.seat.number

    # Who sits there

    async def take(self, rider: DriverConnection, name: str, wanted: int) -> bytes:
        """Let a browser take the wheel, and return its briefing.

        Raises:
            GatewayError: another one has it, or the race gives no seat.
        """
        if self.rider is not None:
            raise GatewayError(
                "used", "another browser drives with this token; ask the organiser for your own"
            )
        self.rider = rider
        try:
            seat = await self._hold_seat(name, wanted)
        except BaseException as error:
            self.release(rider)
            if isinstance(error, RaceError):
                raise _refusal(error) from error
            raise
        if self.rider is not rider:
            raise _displaced()
        return self._begin(seat)

    async def _hold_seat(self, name: str, wanted: int) -> ClientSeat:
        """Return the seat that is held, asked for where there is none."""
        async with self._turn:
            if self.seat is None:
                self.seat = await self._wait_for(partial(self._sit_down, name, wanted))
                self._hud_at = time.monotonic()
            return self.seat

    def take_over(self, rider: DriverConnection) -> bytes | None:
        """Give the wheel back to a browser that comes back; None where no seat is held.

        Raises:
            GatewayError: it is there already, and heard.
        """
        before = self.rider
        if before is not None:
            if time.monotonic() - before.heard_at < STALLED_S:
                raise GatewayError("used", "this driver is here already and drives")
            before.let_go(_displaced())
        if self.seat is None:
            self.rider = None
            return None
        self.rider = rider
        return self._begin(self.seat)

    def _begin(self, seat: ClientSeat) -> bytes:
        self._is_dead = True
        # The secret by which the server knows this seat stays here.
        return encode_welcome(replace(seat.welcome, secret=0))

    def release(self, rider: DriverConnection) -> None:
        """Take note that a browser has gone; its seat is kept for a while."""
        if self.rider is rider:
            self.rider, self._left_at = None, time.monotonic()

    def _sit_down(self, name: str, wanted: int) -> ClientSeat:
        """Take the first seat that is to be had; runs in the pool."""
        refused: SeatError | None = None
        for seat in self._seats(wanted):
            try:
                return self._try_seat(name or f"browser {self.number + 1}", seat)
            except SeatError as error:
                refused = error
        raise refused or SeatError("there is no seat")

    def _try_seat(self, name: str, wanted: int) -> ClientSeat:
        """Take a seat over a link of its own."""
        link = self._connect(wanted)
        try:
            seat = take_seat(link, Join(name, PRESET, wanted))
            link.listen(topics.HUD, self._hear_hud, seat.number)
        except BaseException:
            link.close()
            raise
        return seat

    # What goes up and down

    def drive(self, data: bytes) -> None:
        """Send a control of the browser on, as the answer to the newest moment of the race.

        Raises:
            WireError: it is damaged, or too large.
        """
        frame = decode_control(data)
        if frame.sequence <= self.sequence:
            return  # late, or a copy
        self.sequence, self._control_at = frame.sequence, time.monotonic()
        if self._is_dead:
            self._is_dead = False
            self._tell("driving")
        if self.seat is not None and self._moment is not None:
            self.seat.answer(self._moment[0], self.sequence, self._moment[1], frame.control)

    async def get_ready(self, *, ready: bool) -> None:
        """Tell the server that this driver is ready, or is not.

        Raises:
            RaceError: the server refuses, or does not answer.
        """
        if self.seat is not None:
            await self._wait_for(partial(self.seat.act, topics.READY, ready=ready))

    async def leave(self) -> None:
        """Give the seat up."""
        seat, self.seat, self._moment, self.sequence = self.seat, None, None, 0
        if seat is not None:
            await self._wait_for(partial(_stand_up, seat))

    def _hear_hud(self, data: bytes) -> None:
        """Hand heads-up data to the loop; called by a thread of zenoh."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._take_hud, data)

    def _take_hud(self, data: bytes) -> None:
        try:
            hud = decode_hud(data)
        except WireError:
            return
        self._moment, self._hud_at = (hud.epoch, hud.tick), time.monotonic()
        if self.rider is not None:
            self.rider.outbox.show(HUD, frame_of(data))

    # Looking after it

    def look(self) -> None:
        """Notice what has not happened; called ten times a second."""
        now = time.monotonic()
        if not self._is_dead and now - self._control_at > DEAD_MAN_S:
            self._is_dead = True
            self._tell("dead-man", NO_HAND)
        if self.seat is None or (self._asking is not None and not self._asking.done()):
            return
        if self.rider is None and now - self._left_at > GRACE_S:
            self._asking = self._loop.create_task(self.leave())
        elif now - self._hud_at > SILENCE_S:
            self._hud_at = now
            self._asking = self._loop.create_task(self._ask_whether_it_is_ours(self.seat))

    async def _ask_whether_it_is_ours(self, seat: ClientSeat) -> None:
        """Ask for the seat again: a lobby is silent, but so is a server that gave it away."""
        try:
            await self._wait_for(seat.come_back)
        except SeatError as error:
            if self.seat is not seat:
                return  # given up meanwhile, and perhaps another one taken
            await self.leave()
            if self.rider is not None:
                self.rider.let_go(GatewayError("seat-lost", f"the seat is lost: {error}"))
        except (LinkError, WireError):
            return  # everybody is told that there is no race

    def _tell(self, code: str, reason: str = "") -> None:
        if self.rider is not None:
            self.rider.outbox.put(notice_frame(code, reason))

    async def _wait_for(self, ask: Callable[[], Answer]) -> Answer:
        return await self._loop.run_in_executor(self._pool, ask)


def _stand_up(seat: ClientSeat) -> None:
    """Leave a seat and end its link; runs in the pool."""
    with seat.link:
        try:
            seat.act(topics.LEAVE)
        except RaceError:
            return  # whoever gave it away knows already


def _displaced() -> GatewayError:
    return GatewayError("used", "this driver has come back with another browser")


def _refusal(error: RaceError) -> GatewayError:
    if isinstance(error, SeatError):
        return GatewayError("seat-taken", str(error))
    if isinstance(error, KeysError):
        return GatewayError("token", str(error))
    return GatewayError("no-race", str(error))
