"""One browser from hello to goodbye."""

import asyncio
import json
import time
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any, cast

from starlette.websockets import WebSocket, WebSocketDisconnect

from race_server import __version__
from race_server.errors import GatewayError, RaceError, WireError
from race_server.live.gateway.audience import Viewer
from race_server.live.gateway.connection import PIPE, WebSocketConnection
from race_server.live.gateway.driver_seat import PRESET, DriverSeat
from race_server.live.gateway.handshake import (
    MOST_HZ,
    MOST_SEAT,
    SUBPROTOCOL,
    Hello,
    Role,
    read_bool,
    read_hello,
    read_int,
    read_number,
    read_text,
    read_words,
)
from race_server.live.gateway.hub import Hub
from race_server.live.gateway.limits import (
    CONTROLS_HZ,
    HELLO_S,
    MOST_CONTROL,
    TEXTS_HZ,
    RateLimiter,
)
from race_server.live.gateway.origins import check_origin
from race_server.live.gateway.outbox import Outbox
from race_server.live.gateway.playback import WORDS, Player
from race_server.live.gateway.refusal import CLOSE_CODES, close_reason, refusal_text
from race_server.live.gateway.roles import Identity
from race_server.live.gateway.stewarding import ACTS

# What the page should lag behind, so that it always has two snapshots to draw between [ms].
DELAY_MS = 100
# Who takes no words of farewell is gone without.
FAREWELL_S = 1.0
# Penalties [s], and what a browser's clock may show [ms].
MOST_VALUE, MOST_MOMENT = 1e6, 1e15


class BrowserSession:
    """A browser that is connected."""

    def __init__(self, hub: Hub, websocket: WebSocket) -> None:
        """Know nobody yet."""
        self._hub, self._websocket = hub, websocket
        self._host = websocket.client.host if websocket.client else ""
        self.outbox = Outbox(cast("WebSocketConnection", websocket.scope["extensions"][PIPE]))
        self.heard_at = time.monotonic()
        self._ended = asyncio.Event()
        self._why: GatewayError | None = None
        self._identity = Identity(Role.SPECTATE)
        self._viewer = Viewer(self.outbox, MOST_HZ)
        self._wheel: DriverSeat | None = None
        self._player: Player | None = None
        self._texts = RateLimiter(TEXTS_HZ, "texts")
        self._controls = RateLimiter(CONTROLS_HZ, "controls")

    def let_go(self, error: GatewayError) -> None:
        """End, with a reason."""
        self._why = self._why or error
        self._ended.set()

    async def serve(self) -> None:
        """Serve it until it goes, or is let go."""
        offered = self._websocket.scope["subprotocols"]
        await self._websocket.accept(SUBPROTOCOL if SUBPROTOCOL in offered else None)
        try:
            await self._greet(offered)
            await self._converse()
        except GatewayError as error:
            self._hub.note_refusal(error, self._host)
            await self._refuse(error)
        finally:
            self._hub.live.leave(self._viewer)
            self._hub.dismiss(self, self._host)
            if self._wheel is not None:
                self._wheel.release(self)

    # Who it is

    async def _greet(self, offered: list[str]) -> None:
        settings = self._hub.settings
        headers = self._websocket.headers
        check_origin(headers, settings.origins, is_local=settings.is_local)
        if SUBPROTOCOL not in offered:
            raise GatewayError("malformed", f"speak the subprotocol {SUBPROTOCOL}")
        self._hub.admit(self, self._host)
        hello = await self._hear_hello()
        passes = self._hub.passes
        if hello.resume:
            self._identity = passes.look(hello.resume)
        else:
            self._identity = settings.tokens.identify(hello)
        self._viewer.rate = hello.rate
        if self._identity.role is Role.DRIVE:
            await self._greet_driver(hello)
        elif hello.recording:
            await self._greet_reader(hello)
        else:
            self._welcome("live", settings.session)
            self._hub.live.join(self._viewer)
        passes.spend(hello.resume)

    async def _hear_hello(self) -> Hello:
        try:
            async with asyncio.timeout(HELLO_S):
                message = await self._websocket.receive()
        except TimeoutError as error:
            raise GatewayError(
                "late", f"nothing was said within {HELLO_S:g} s; say who you are first"
            ) from error
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message["code"])
        return read_hello(message.get("text") or message.get("bytes"))

    async def _greet_driver(self, hello: Hello) -> None:
        if hello.recording:
            raise GatewayError("malformed", "a recording cannot be driven")
        wheel, identity = self._hub.wheels[self._identity.wheel], self._identity
        briefing = wheel.take_over(self) if hello.resume else None
        if briefing is None:
            briefing = await wheel.take(self, identity.name, hello.seat)
        self._wheel = wheel
        self._viewer.seat = wheel.number_of_seat
        more = {"seat": wheel.number_of_seat, "sequence": wheel.sequence, "preset": PRESET}
        self._welcome("live", self._hub.settings.session, **more)
        self._hub.live.join(self._viewer)
        self.outbox.tell(briefing)

    async def _greet_reader(self, hello: Hello) -> None:
        loop, pool = asyncio.get_running_loop(), self._hub.readers
        tape, events = await loop.run_in_executor(pool, self._hub.library.open, hello.recording)
        self._player = Player(self._viewer, tape, events, pool)
        self._welcome(hello.source, tape.start.session)

    def _welcome(self, source: str, session: str, **more: Any) -> None:
        identity = self._identity
        may = {"may": list(ACTS)} if identity.role is Role.STEWARD else {}
        self._tell(
            type="welcome",
            role=identity.role.value,
            session=session,
            source=source,
            resume=self._hub.passes.issue(identity),
            delay_ms=DELAY_MS,
            version=__version__,
            **may,
            **more,
        )

    # What it says

    async def _converse(self) -> None:
        """Listen until the browser goes, is let go, or its recording cannot be played."""
        work: list[Coroutine[Any, Any, object]] = [self._listen(), self._ended.wait()]
        if self._player is not None:
            work.append(self._player.run())
        tasks = [asyncio.create_task(one) for one in work]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
            if self._why is not None:
                raise self._why
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _listen(self) -> None:
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            self.heard_at = time.monotonic()
            data = message.get("bytes")
            if data is not None:
                self._take_control(data)
            elif not await self._take_words(read_words(message.get("text"))):
                return

    def _take_control(self, data: bytes) -> None:
        if self._wheel is None:
            raise GatewayError("malformed", "bytes, which only drivers send")
        if len(data) > MOST_CONTROL:
            raise GatewayError("too-large", f"a control of more than {MOST_CONTROL} bytes")
        self._controls.spend()
        try:
            self._wheel.drive(data)
        except WireError as error:
            raise GatewayError("malformed", f"no control: {error}") from error

    async def _take_words(self, words: dict[str, Any]) -> bool:
        """Do what is asked for; False where the browser leaves."""
        self._texts.spend()
        kind = read_text(words, "type", 16)
        if kind == "ping":
            moment = read_number(words, "t", -MOST_MOMENT, MOST_MOMENT, default=0.0)
            self._tell(type="pong", t=moment, server_us=self._hub.live.server_us())
        elif kind == "follow":
            self._viewer.seat = read_int(words, "seat", -1, MOST_SEAT, default=-1)
            self._viewer.wants_rays = read_bool(words, "rays") and self._viewer.seat >= 0
            if self._player is not None:
                self._player.turn()
        elif kind == "rate":
            self._viewer.rate = read_number(words, "rate", 1.0, MOST_HZ, default=MOST_HZ)
        elif kind in WORDS and self._player is not None:
            self._player.obey(words)
        elif kind in {"ready", "leave"} and self._wheel is not None:
            return await self._take_drivers_words(kind, words, self._wheel)
        elif kind in {"act", "log"} and self._identity.role is Role.STEWARD:
            await self._take_stewards_words(kind, words)
        else:
            raise GatewayError("malformed", f"{kind!r} means nothing from you here")
        return True

    async def _take_drivers_words(
        self, kind: str, words: dict[str, Any], wheel: DriverSeat
    ) -> bool:
        if kind == "leave":
            await wheel.leave()
            await self._websocket.close()
            return False
        ready, reason = read_bool(words, "ready"), ""
        try:
            await wheel.get_ready(ready=ready)
        except RaceError as error:
            reason = str(error)
        self._tell(type="ready", ready=ready, accepted=not reason, reason=reason)
        return True

    async def _take_stewards_words(self, kind: str, words: dict[str, Any]) -> None:
        stewarding, who = self._hub.stewarding, self._identity.name
        if kind == "log":
            try:
                self._tell(type="log", lines=await stewarding.log(who))
            except RaceError as error:
                self._tell(type="log", lines=[], reason=str(error))
            return
        number = read_int(words, "id", 0, 1 << 53, default=0)
        reason = await stewarding.decide(
            read_text(words, "act", 16),
            read_int(words, "seat", -1, MOST_SEAT, default=-1),
            read_number(words, "value", -MOST_VALUE, MOST_VALUE, default=0.0),
            who,
        )
        self._tell(type="acted", id=number, accepted=not reason, reason=reason)

    # What it is told

    def _tell(self, **words: Any) -> None:
        self.outbox.tell(json.dumps(words))

    async def _refuse(self, error: GatewayError) -> None:
        """Say why, and close; a browser that takes no words is gone without."""
        with suppress(TimeoutError):
            async with asyncio.timeout(FAREWELL_S):
                await self._websocket.send_text(refusal_text(error))
                await self._websocket.close(CLOSE_CODES[error.code], close_reason(error))
