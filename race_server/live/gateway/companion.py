"""What the driver of a seat must see, for browsers beside that driver: they drive nothing."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor

from race_server.errors import GatewayError, KeysError, RaceError, WireError
from race_server.live.gateway.audience import HINT, HUD, OWN_ALERT, OWN_POSE, Outbox
from race_server.live.gateway.frames import frame_of
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.alert import decode_alert
from race_server.net.wire.drive import decode_hud
from race_server.net.wire.hint import decode_hint
from race_server.net.wire.pose import decode_pose
from race_server.net.wire.topics import Topic

Connect = Callable[[], ClientLink]
# What comes from the race, and from the kart's own program; how each is named and checked.
OF_RACE, OF_KART = (topics.HUD, topics.COACH), (topics.OWN_POSE, topics.OWN_ALERT)
_KINDS: dict[Topic, tuple[str, Callable[[bytes], object]]] = {
    topics.HUD: (HUD, decode_hud),
    topics.COACH: (HINT, decode_hint),
    topics.OWN_POSE: (OWN_POSE, decode_pose),
    topics.OWN_ALERT: (OWN_ALERT, decode_alert),
}


class CompanionSeat:
    """One seat, held by another program such as that of a real kart, and who looks on."""

    def __init__(
        self,
        number: int,
        race: Connect,
        kart: Connect | None,
        pool: Executor,
        retry_s: float,
    ) -> None:
        """Listen to nothing yet.

        race, kart: return a link of this seat to the race, and to the kart's own program, None
        where that is not on this machine; pool: for blocking work; retry_s: between attempts.
        """
        self.number = number
        self._race, self._kart, self._pool, self._retry_s = race, kart, pool, retry_s
        self._loop = asyncio.get_running_loop()
        self._outboxes: set[Outbox] = set()
        self._links: list[ClientLink] = []
        self._connecting = asyncio.Lock()
        self._attempts: list[asyncio.Task[None]] = []

    async def join(self, outbox: Outbox) -> None:
        """Send what the driver must see to a browser from now on.

        Where the kart's own program is on this machine no race has to be there.

        Raises:
            GatewayError: there are no keys of that seat, or the race does not answer.
        """
        if self._kart is not None:
            if not self._attempts:
                sources = (self._race, OF_RACE), (self._kart, OF_KART)
                self._attempts = [
                    asyncio.create_task(self._connect_at_last(*source)) for source in sources
                ]
        else:
            async with self._connecting:
                if not self._links:
                    await self._connect_at_once()
        self._outboxes.add(outbox)

    def leave(self, outbox: Outbox) -> None:
        """Send a browser no more; the links stay for the next one."""
        self._outboxes.discard(outbox)

    async def close(self) -> None:
        """Close the links."""
        for attempt in self._attempts:
            attempt.cancel()
        links, self._links = self._links, []
        for link in links:
            await self._loop.run_in_executor(self._pool, link.close)

    async def _connect_at_once(self) -> None:
        try:
            await self._connect(self._race, OF_RACE)
        except KeysError as error:
            raise GatewayError("token", str(error)) from error
        except RaceError as error:
            raise GatewayError("no-race", str(error)) from error

    async def _connect_at_last(self, connect: Connect, wanted: tuple[Topic, ...]) -> None:
        """Connect, again and again until that works; zenoh reconnects by itself from then on."""
        while True:
            try:
                return await self._connect(connect, wanted)
            except RaceError:
                await asyncio.sleep(self._retry_s)

    async def _connect(self, connect: Connect, wanted: tuple[Topic, ...]) -> None:
        link = await self._loop.run_in_executor(self._pool, self._listen, connect, wanted)
        self._links.append(link)

    def _listen(self, connect: Connect, wanted: tuple[Topic, ...]) -> ClientLink:
        link = connect()
        try:
            for topic in wanted:
                link.listen(topic, self._receiver_of(topic), self.number)
        except BaseException:
            link.close()
            raise
        return link

    def _receiver_of(self, topic: Topic) -> Callable[[bytes], None]:
        """Return what passes messages to the event loop; called by a thread of zenoh."""
        kind, decode = _KINDS[topic]

        def receive(data: bytes) -> None:
            if not self._loop.is_closed():
                self._loop.call_soon_threadsafe(self._publish, kind, decode, data)

        return receive

    def _publish(self, kind: str, decode: Callable[[bytes], object], data: bytes) -> None:
        try:
            decode(data)
        except WireError:
            return
        for outbox in self._outboxes:
            outbox.send_newest(kind, frame_of(data))
