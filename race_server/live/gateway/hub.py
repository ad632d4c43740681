"""What all browsers share: the race, the seats that they drive, the tokens, and the bounds."""

import asyncio
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Protocol

from race_server.errors import GatewayError
from race_server.live.gateway.audience import RAYS
from race_server.live.gateway.connection import frame_of
from race_server.live.gateway.driver_seat import DriverSeat
from race_server.live.gateway.library import Library
from race_server.live.gateway.limits import MOST_BROWSERS, MOST_OF_ADDRESS
from race_server.live.gateway.listener import Listener
from race_server.live.gateway.live import LiveRace
from race_server.live.gateway.origins import is_loopback
from race_server.live.gateway.outbox import Outbox
from race_server.live.gateway.rays import Caster
from race_server.live.gateway.roles import ResumeTokens
from race_server.live.gateway.settings import Settings
from race_server.live.gateway.stewarding import Stewarding
from race_server.logs import Log
from race_server.net.auth.keys import ClientKeys
from race_server.net.auth.token import read_token
from race_server.net.transport import ClientLink
from race_server.net.wire.lobby import CourseSheet
from race_server.net.wire.rays import RaysFrame, encode_rays
from race_server.net.wire.spectate import SnapshotFrame
from race_server.net.wire.topics import Topic

# What waits for the race, and what waits for the disk: so many at once.
MOST_WAITING, MOST_READING = 8, 4
CONNECT_S = 2.0
# Between two looks at seats and rays, and between two at browsers that do not read.
LOOK_S, CHECK_S = 0.1, 1.0
# Refusals are told once for each reason and address; so many of these are remembered.
MOST_TOLD = 1024


class Connection(Protocol):
    """A browser that was let in."""

    outbox: Outbox

    def let_go(self, error: GatewayError) -> None:
        """End, with a reason."""


class Hub:
    """Made within a running loop, for as long as it runs."""

    def __init__(self, settings: Settings, log: Log) -> None:
        """Prepare for browsers."""
        self.settings, self.log = settings, log
        self.pool = ThreadPoolExecutor(MOST_WAITING, thread_name_prefix="race")
        # Recordings have threads of their own: whoever reads many holds up no driver.
        self.readers = ThreadPoolExecutor(MOST_READING, thread_name_prefix="recordings")
        self.listener = Listener(self._watch, self._hear)
        self.live = LiveRace(asyncio.get_running_loop(), log, self.listener.ask_again)
        self.library = Library(settings.recordings)
        self.passes = ResumeTokens()
        self.wheels = [
            DriverSeat(number, self._drive, settings.ring.seats, self.pool)
            for number in range(len(settings.tokens.drive))
        ]
        self.stewarding = Stewarding(self._steward, self._token, self.pool)
        self.guests: set[Connection] = set()
        self._hosts: Counter[str] = Counter()
        self._told: set[tuple[str, str]] = set()
        self._caster: Caster | None = None
        self._course: CourseSheet | None = None

    # Links to the race

    def _watch(self) -> ClientLink:
        return self._link(self.settings.ring.of_watcher())

    def _drive(self, seat: int) -> ClientLink:
        return self._link(self.settings.ring.of_seat(seat))

    def _steward(self) -> ClientLink:
        return self._link(self.settings.ring.of_steward())

    def _link(self, keys: ClientKeys | None) -> ClientLink:
        address, session = self.settings.address, self.settings.session
        return ClientLink(address, session, keys=keys, timeout_s=CONNECT_S)

    def _token(self) -> str:
        """Return the steward's token of the race: a server that is started anew has another."""
        keys = self.settings.ring.of_steward()
        return keys.token if keys else read_token(self.settings.address, self.settings.session)

    def _hear(self, topic: Topic | None, data: bytes) -> None:
        self.live.hear(topic, data)

    # Who is here

    def admit(self, guest: Connection, host: str) -> None:
        """Let a browser in.

        Raises:
            GatewayError: there are too many, of all or of its address.
        """
        if len(self.guests) >= MOST_BROWSERS:
            raise GatewayError("full", f"{MOST_BROWSERS} browsers are here already; come back")
        if self._hosts[host] >= MOST_OF_ADDRESS and not is_loopback(host):
            raise GatewayError(
                "full", f"{MOST_OF_ADDRESS} browsers of your address are here already; close some"
            )
        self.guests.add(guest)
        self._hosts[host] += 1

    def dismiss(self, guest: Connection, host: str) -> None:
        """Take note that a browser has gone."""
        if guest in self.guests:
            self.guests.discard(guest)
            self._hosts[host] -= 1
            if not self._hosts[host]:
                del self._hosts[host]

    def note_refusal(self, error: GatewayError, host: str) -> None:
        """Log a refusal, once for each reason and address."""
        if (error.code, host) not in self._told and len(self._told) < MOST_TOLD:
            self._told.add((error.code, host))
            self.log.warn("refused", code=error.code, address=host, why=str(error))

    # What goes on by itself

    async def look_after(self) -> None:
        """Look after seats, rays and browsers that do not read, until cancelled."""
        checked = 0.0
        loop = asyncio.get_running_loop()
        while True:
            for wheel in self.wheels:
                wheel.look()
            await self._show_rays()
            if loop.time() - checked > CHECK_S:
                checked = loop.time()
                self._check_guests()
            await asyncio.sleep(LOOK_S)

    def _check_guests(self) -> None:
        for guest in list(self.guests):
            try:
                guest.outbox.check()
            except GatewayError as error:
                guest.let_go(error)

    async def _show_rays(self) -> None:
        """Cast the rays that somebody wants to see of the live race."""
        live = self.live
        wanted = {viewer.seat for viewer in live.audience if viewer.wants_rays}
        if not wanted or live.snapshot is None or live.course is None:
            return
        if self._caster is None or self._course is not live.course:
            self._course, self._caster = live.course, Caster(live.course)
        work = partial(_cast_all, self._caster, live.snapshot, wanted)
        rays = await asyncio.get_running_loop().run_in_executor(self.pool, work)
        frames = {one.seat: frame_of(encode_rays(one)) for one in rays}
        for viewer in live.audience:
            if viewer.wants_rays and viewer.seat in frames:
                viewer.outbox.show(RAYS, frames[viewer.seat])

    async def close(self) -> None:
        """Leave all seats and end all links."""
        await asyncio.gather(*(wheel.leave() for wheel in self.wheels), return_exceptions=True)
        await self.stewarding.close()
        for pool in (self.pool, self.readers):
            pool.shutdown(wait=False, cancel_futures=True)


def _cast_all(caster: Caster, snapshot: SnapshotFrame, seats: set[int]) -> list[RaysFrame]:
    cast = (caster.cast(snapshot, seat) for seat in seats)
    return [rays for rays in cast if rays is not None]
