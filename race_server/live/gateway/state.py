"""What all browser sessions of a gateway share: the race, the driven seats, tokens and limits."""

import asyncio
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Protocol

from race_server.errors import GatewayError
from race_server.live.gateway.audience import RAYS, Outbox
from race_server.live.gateway.companion import CompanionSeat
from race_server.live.gateway.connection_limiter import network_of
from race_server.live.gateway.driver_seat import DriverSeat
from race_server.live.gateway.frames import frame_of
from race_server.live.gateway.library import Library
from race_server.live.gateway.listener import Listener
from race_server.live.gateway.live import LiveRace
from race_server.live.gateway.origins import is_loopback
from race_server.live.gateway.rays import RayCaster
from race_server.live.gateway.roles import ResumeTokens
from race_server.live.gateway.settings import Settings
from race_server.live.gateway.stewarding import Stewarding
from race_server.logs import Log, RefusalLog
from race_server.net.auth.keys import ClientKeys
from race_server.net.auth.token import read_token
from race_server.net.transport import ClientLink
from race_server.net.wire.lobby import CourseSheet
from race_server.net.wire.parking import LotFrame
from race_server.net.wire.rays import RaysFrame, encode_rays
from race_server.net.wire.spectate import SnapshotFrame
from race_server.net.wire.topics import Topic


class Connection(Protocol):
    """A browser that was admitted."""

    outbox: Outbox

    def disconnect(self, error: GatewayError) -> None:
        """End, with a reason."""


class GatewayState:
    """Made within a running loop, for as long as it runs."""

    def __init__(self, settings: Settings, log: Log) -> None:
        """Prepare for browsers."""
        self.settings, self.log = settings, log
        limits, timing = settings.limits, settings.timing
        self.pool = ThreadPoolExecutor(limits.race_threads, thread_name_prefix="race")
        # Recordings have separate threads, so that reading many delays no driver.
        self.readers = ThreadPoolExecutor(limits.recording_threads, thread_name_prefix="recordings")
        self.listener = Listener(self._connect_spectator, self._receive, timing)
        self.live = LiveRace(
            asyncio.get_running_loop(), log, self.listener.request_all, limits.race_messages
        )
        self.library = Library(settings.recordings, limits)
        self.resume_tokens = ResumeTokens(limits.resume_tokens)
        self.driver_seats = [
            DriverSeat(number, self._connect_driver, settings.ring.seats, self.pool, timing)
            for number in range(len(settings.tokens.drive))
        ]
        self.companion_seats = {
            seat: CompanionSeat(
                seat,
                partial(self._connect_driver, seat),
                self._connect_kart if settings.kart else None,
                self.pool,
                timing.reconnect_s,
            )
            for seat, _ in settings.tokens.companion
        }
        self.stewarding = Stewarding(self._connect_steward, self._token, self.pool)
        self.browsers: set[Connection] = set()
        self._hosts: Counter[str] = Counter()
        self._refusals = RefusalLog(log)
        self._caster: RayCaster | None = None
        self._course: CourseSheet | None = None

    # Links to the race

    def _connect_spectator(self) -> ClientLink:
        return self._connect(self.settings.ring.of_spectator())

    def _connect_driver(self, seat: int) -> ClientLink:
        return self._connect(self.settings.ring.of_seat(seat))

    def _connect_steward(self) -> ClientLink:
        return self._connect(self.settings.ring.of_steward())

    def _connect_kart(self) -> ClientLink:
        """Return a link to the program of the kart on this machine."""
        settings = self.settings
        return ClientLink(settings.kart, settings.session, timeout_s=settings.timing.connect_s)

    def _connect(self, keys: ClientKeys | None) -> ClientLink:
        settings = self.settings
        timeout_s = settings.timing.connect_s
        return ClientLink(settings.address, settings.session, keys=keys, timeout_s=timeout_s)

    def _token(self) -> str:
        """Return the race's steward token: a server that is started again has another."""
        keys = self.settings.ring.of_steward()
        return keys.token if keys else read_token(self.settings.address, self.settings.session)

    def _receive(self, topic: Topic | None, data: bytes) -> None:
        self.live.receive(topic, data)

    # Browsers

    def admit(self, browser: Connection, host: str) -> None:
        """Add a browser.

        Raises:
            GatewayError: there are too many, in total or of its address.
        """
        limits = self.settings.limits
        if len(self.browsers) >= limits.browsers:
            raise GatewayError("full", f"{limits.browsers} browsers are here already; come back")
        most, network = limits.browsers_per_address, network_of(host)
        if self._hosts[network] >= most and not is_loopback(host):
            raise GatewayError(
                "full", f"{most} browsers of your address are here already; close some"
            )
        self.browsers.add(browser)
        self._hosts[network] += 1

    def remove(self, browser: Connection, host: str) -> None:
        """Remove a browser, if it was admitted."""
        if browser in self.browsers:
            self.browsers.discard(browser)
            network = network_of(host)
            self._hosts[network] -= 1
            if not self._hosts[network]:
                del self._hosts[network]

    def log_refusal(self, error: GatewayError, host: str) -> None:
        """Log a refusal, unless one for the same reason and address was logged just now."""
        address = network_of(host)
        self._refusals.record(error.code, address, address=address, why=str(error))

    # Periodic work

    async def run(self) -> None:
        """Poll seats, cast rays and check that browsers read, until cancelled."""
        timing, checked = self.settings.timing, 0.0
        loop = asyncio.get_running_loop()
        while True:
            for seat in self.driver_seats:
                seat.poll()
            await self._publish_rays()
            if loop.time() - checked > timing.check_s:
                checked = loop.time()
                self._check_browsers()
            await asyncio.sleep(timing.poll_s)

    def _check_browsers(self) -> None:
        for browser in list(self.browsers):
            try:
                browser.outbox.check()
            except GatewayError as error:
                browser.disconnect(error)

    async def _publish_rays(self) -> None:
        """Cast the rays that viewers of the live race want to see."""
        view, audience = self.live.view, self.live.audience
        wanted = {viewer.seat for viewer in audience if viewer.wants_rays}
        if not wanted or view.snapshot is None or view.course is None:
            return
        if self._caster is None or self._course is not view.course:
            self._course, self._caster = view.course, RayCaster(view.course)
        work = partial(_cast_all, self._caster, view.snapshot, view.lot, wanted)
        rays = await asyncio.get_running_loop().run_in_executor(self.pool, work)
        frames = {one.seat: frame_of(encode_rays(one)) for one in rays}
        for viewer in audience:
            if viewer.wants_rays and viewer.seat in frames:
                viewer.outbox.send_newest(RAYS, frames[viewer.seat])

    async def close(self) -> None:
        """Leave all seats and close all links."""
        leaving = [seat.leave() for seat in self.driver_seats]
        leaving += [seat.close() for seat in self.companion_seats.values()]
        await asyncio.gather(*leaving, return_exceptions=True)
        await self.stewarding.close()
        for pool in (self.pool, self.readers):
            pool.shutdown(wait=False, cancel_futures=True)


def _cast_all(
    caster: RayCaster, snapshot: SnapshotFrame, lot: LotFrame | None, seats: set[int]
) -> list[RaysFrame]:
    cast = (caster.cast(snapshot, seat, lot) for seat in seats)
    return [rays for rays in cast if rays is not None]
