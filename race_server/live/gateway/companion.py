"""What the driver of a seat must see, for browsers beside that driver: they drive nothing."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor

from race_server.errors import GatewayError, KeysError, RaceError, WireError
from race_server.live.gateway.audience import HUD, Outbox
from race_server.live.gateway.frames import frame_of
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.drive import decode_hud


class CompanionSeat:
    """One seat, held by another program such as that of a real kart, and who looks on."""

    def __init__(self, number: int, connect: Callable[[int], ClientLink], pool: Executor) -> None:
        """Listen to nothing yet. connect: returns a link for a seat; pool: for blocking work."""
        self.number = number
        self._connect, self._pool = connect, pool
        self._loop = asyncio.get_running_loop()
        self._outboxes: set[Outbox] = set()
        self._link: ClientLink | None = None
        self._connecting = asyncio.Lock()

    async def join(self, outbox: Outbox) -> None:
        """Send the seat's heads-up data to a browser from now on.

        Raises:
            GatewayError: there are no keys of that seat, or the race does not answer.
        """
        async with self._connecting:
            if self._link is None:
                try:
                    self._link = await self._loop.run_in_executor(self._pool, self._listen)
                except KeysError as error:
                    raise GatewayError("token", str(error)) from error
                except RaceError as error:
                    raise GatewayError("no-race", str(error)) from error
        self._outboxes.add(outbox)

    def leave(self, outbox: Outbox) -> None:
        """Send a browser no more; the link stays for the next one."""
        self._outboxes.discard(outbox)

    async def close(self) -> None:
        """Close the link."""
        link, self._link = self._link, None
        if link is not None:
            await self._loop.run_in_executor(self._pool, link.close)

    def _listen(self) -> ClientLink:
        link = self._connect(self.number)
        try:
            link.listen(topics.HUD, self._receive, self.number)
        except BaseException:
            link.close()
            raise
        return link

    def _receive(self, data: bytes) -> None:
        """Pass heads-up data to the event loop; called by a thread of zenoh."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._publish, data)

    def _publish(self, data: bytes) -> None:
        try:
            decode_hud(data)
        except WireError:
            return
        for outbox in self._outboxes:
            outbox.send_newest(HUD, frame_of(data))
