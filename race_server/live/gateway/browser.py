"""One browser, from its first message to the end of its connection."""

import asyncio
import json
import time
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any, cast

from starlette.websockets import WebSocket, WebSocketDisconnect

from race_server.errors import GatewayError, RaceError, WireError
from race_server.live.gateway.audience import FrameSink, Outbox, Viewer
from race_server.live.gateway.companion import CompanionSeat
from race_server.live.gateway.connection import CONNECTION
from race_server.live.gateway.driver_seat import PRESET, DriverSeat
from race_server.live.gateway.handshake import (
    CLOSE_CODES,
    MAX_RATE,
    SUBPROTOCOL,
    Hello,
    Role,
    close_reason,
    read_hello,
    refusal_text,
)
from race_server.live.gateway.limits import RateLimiter
from race_server.live.gateway.origins import check_origin
from race_server.live.gateway.playback import Player
from race_server.live.gateway.requests import PLAYER_REQUESTS, Request, read_request
from race_server.live.gateway.roles import Identity
from race_server.live.gateway.state import GatewayState
from race_server.live.gateway.stewarding import ACTS
from race_server.net.wire import topics
from race_server.version import __version__

# What a driver asks of the race for its seat.
_OF_SEAT = {"ready": topics.READY, "park": topics.PARK}


class BrowserSession:
    """A browser that is connected."""

    def __init__(self, state: GatewayState, websocket: WebSocket) -> None:
        """Begin as a spectator that has not authenticated."""
        self._state, self._websocket = state, websocket
        self._limits, self._timing = state.settings.limits, state.settings.timing
        self._host = websocket.client.host if websocket.client else ""
        connection = cast("FrameSink", websocket.scope["extensions"][CONNECTION])
        self._connection = connection
        self.outbox = Outbox(connection, self._limits, self._timing.unread_s)
        self.received_at = time.monotonic()
        self._ended = asyncio.Event()
        self._why: GatewayError | None = None
        self._identity = Identity(Role.SPECTATE)
        self._resume_token = ""
        self._viewer = Viewer(self.outbox, MAX_RATE)
        self._driver_seat: DriverSeat | None = None
        self._companion_seat: CompanionSeat | None = None
        self._player: Player | None = None
        burst_s = self._limits.burst_s
        self._texts = RateLimiter(self._limits.texts_hz, "texts", burst_s)
        self._controls = RateLimiter(self._limits.controls_hz, "controls", burst_s)
        self._protests = RateLimiter(self._limits.protests_hz, "protests", burst_s)

    def disconnect(self, error: GatewayError) -> None:
        """End, with a reason."""
        self._why = self._why or error
        self._ended.set()

    async def serve(self) -> None:
        """Serve the browser until it leaves, or is disconnected."""
        offered = self._websocket.scope["subprotocols"]
        await self._websocket.accept(SUBPROTOCOL if SUBPROTOCOL in offered else None)
        try:
            await self._authenticate(offered)
            await self._run()
        except GatewayError as error:
            self._state.log_refusal(error, self._host)
            await self._refuse(error)
        finally:
            self._state.live.leave(self._viewer)
            self._state.remove(self, self._host)
            if self._driver_seat is not None:
                self._driver_seat.release(self)
            if self._companion_seat is not None:
                self._companion_seat.leave(self.outbox)

    # The first message

    async def _authenticate(self, offered: list[str]) -> None:
        settings = self._state.settings
        headers = self._websocket.headers
        check_origin(headers, settings.origins, is_local=settings.is_local)
        if SUBPROTOCOL not in offered:
            raise GatewayError("malformed", f"speak the subprotocol {SUBPROTOCOL}")
        self._state.admit(self, self._host)
        hello = await self._receive_hello()
        resume_tokens = self._state.resume_tokens
        if hello.resume:
            self._identity = resume_tokens.find(hello.resume)
        else:
            self._identity = settings.tokens.identify(hello)
        self._viewer.rate = hello.rate
        if self._identity.role is Role.DRIVE:
            await self._begin_driving(hello)
        elif self._identity.role is Role.COMPANION:
            await self._begin_beside(hello)
        elif hello.recording:
            await self._begin_playing(hello)
        else:
            self._send_welcome("live", settings.session)
            self._state.live.join(self._viewer)
        resume_tokens.revoke(hello.resume)
        self._connection.on_admitted()

    async def _receive_hello(self) -> Hello:
        hello_s = self._timing.hello_s
        try:
            async with asyncio.timeout(hello_s):
                message = await self._websocket.receive()
        except TimeoutError as error:
            raise GatewayError(
                "late", f"nothing was said within {hello_s:g} s; say who you are first"
            ) from error
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message["code"])
        text = message.get("text")
        self._check_length(text)
        return read_hello(text)

    async def _begin_driving(self, hello: Hello) -> None:
        if hello.recording:
            raise GatewayError("malformed", "a recording cannot be driven")
        seat, identity = self._state.driver_seats[self._identity.number], self._identity
        briefing = seat.resume(self) if hello.resume else None
        if briefing is None:
            briefing = await seat.claim(self, identity.name, hello.seat)
        self._driver_seat = seat
        self._viewer.seat = seat.number_of_seat
        more = {"seat": seat.number_of_seat, "sequence": seat.sequence, "preset": PRESET}
        moment = self._state.live.moment
        more |= {kind: seat.has_asked(topic, moment) for kind, topic in _OF_SEAT.items()}
        self._send_welcome("live", self._state.settings.session, **more)
        self._state.live.join(self._viewer)
        self.outbox.send(briefing)

    async def _begin_beside(self, hello: Hello) -> None:
        if hello.recording:
            raise GatewayError("malformed", "a recording has no driver to be beside")
        seat = self._state.companion_seats[self._identity.number]
        await seat.join(self.outbox)
        self._companion_seat = seat
        self._viewer.seat = seat.number
        self._send_welcome("live", self._state.settings.session, seat=seat.number)
        self._state.live.join(self._viewer)

    async def _begin_playing(self, hello: Hello) -> None:
        loop, pool = asyncio.get_running_loop(), self._state.readers
        recording, events = await loop.run_in_executor(
            pool, self._state.library.open, hello.recording
        )
        self._player = Player(self._viewer, recording, events, pool, self._timing)
        self._send_welcome(hello.source, recording.start.session)

    def _send_welcome(self, source: str, session: str, **more: Any) -> None:
        identity = self._identity
        self._resume_token = self._state.resume_tokens.issue(identity)
        may = {"may": list(ACTS)} if identity.role is Role.STEWARD else {}
        self._send(
            type="welcome",
            role=identity.role.value,
            session=session,
            source=source,
            resume=self._resume_token,
            delay_ms=round(1e3 * self._timing.page_delay_s),
            version=__version__,
            **may,
            **more,
        )

    # Later messages

    async def _run(self) -> None:
        """Receive until the browser leaves or is disconnected, or its recording ends it."""
        work: list[Coroutine[Any, Any, object]] = [self._receive_all(), self._ended.wait()]
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

    async def _receive_all(self) -> None:
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            self.received_at = time.monotonic()
            data, text = message.get("bytes"), message.get("text")
            if data is not None:
                self._receive_control(data)
                continue
            self._check_length(text)
            if not await self._handle(read_request(text)):
                return

    def _check_length(self, text: str | None) -> None:
        most = self._limits.text_bytes
        if text is not None and len(text.encode()) > most:
            raise GatewayError("too-large", f"a message of more than {most} bytes; send less")

    def _receive_control(self, data: bytes) -> None:
        if self._driver_seat is None:
            raise GatewayError("malformed", "bytes, which only drivers send")
        most = self._limits.control_bytes
        if len(data) > most:
            raise GatewayError("too-large", f"a control of more than {most} bytes")
        self._controls.spend()
        try:
            self._driver_seat.send_control(data)
        except WireError as error:
            raise GatewayError("malformed", f"no control: {error}") from error

    async def _handle(self, request: Request) -> bool:
        """Do what a browser asks for; False where it leaves."""
        self._texts.spend()
        kind = request["type"]
        if kind == "ping":
            server_us = self._state.live.server_us()
            known = {} if server_us is None else {"server_us": server_us}
            self._send(type="pong", t=request["t"], **known)
        elif kind == "follow":
            self._viewer.seat = request["seat"]
            self._viewer.wants_rays = request["rays"] and self._viewer.seat >= 0
            if self._player is not None:
                self._player.refresh()
        elif kind == "rate":
            self._viewer.rate = request["rate"]
        elif kind in PLAYER_REQUESTS and self._player is not None:
            self._player.handle(request)
        elif kind in {"ready", "park", "leave"} and self._driver_seat is not None:
            return await self._handle_driver(request, self._driver_seat)
        elif kind == "use" and self._companion_seat is not None:
            reason = await self._state.stewarding.use_item(self._companion_seat.number)
            self._send(type="use", accepted=not reason, reason=reason)
        elif kind == "protest" and self._driver_seat is not None:
            await self._handle_protest(request, self._driver_seat)
        elif kind in {"act", "log"} and self._identity.role is Role.STEWARD:
            await self._handle_steward(request)
        else:
            raise GatewayError("malformed", f"{kind!r} means nothing from you here")
        return True

    async def _handle_driver(self, request: Request, seat: DriverSeat) -> bool:
        if request["type"] == "leave":
            self._state.resume_tokens.revoke(self._resume_token)
            await seat.leave()
            await self._websocket.close()
            return False
        kind, reason = request["type"], ""
        wanted = request[kind]
        try:
            await seat.ask(_OF_SEAT[kind], wanted=wanted, moment=self._state.live.moment)
        except RaceError as error:
            reason = str(error)
        self._send(type=kind, accepted=not reason, reason=reason, **{kind: wanted})
        return True

    async def _handle_protest(self, request: Request, seat: DriverSeat) -> None:
        own, against = seat.number_of_seat, request["against"]
        try:
            self._protests.spend()
            reason = await self._state.stewarding.protest(own, against, request["why"])
        except GatewayError as error:
            reason = str(error)
        self._send(type="protest", accepted=not reason, reason=reason)

    async def _handle_steward(self, request: Request) -> None:
        stewarding, who = self._state.stewarding, self._identity.name
        if request["type"] == "log":
            try:
                self._send(type="log", lines=await stewarding.log(who))
            except RaceError as error:
                self._send(type="log", lines=[], reason=str(error))
            return
        what = {key: request[key] for key in ("seat", "value", "against", "protest", "note")}
        reason = await stewarding.decide(request["act"], who, **what)
        self._send(type="acted", id=request["id"], accepted=not reason, reason=reason)

    # What it is sent

    def _send(self, **message: Any) -> None:
        self.outbox.send(json.dumps(message))

    async def _refuse(self, error: GatewayError) -> None:
        """Send the reason and close; a browser that does not read is closed without."""
        with suppress(TimeoutError):
            async with asyncio.timeout(self._timing.farewell_s):
                await self._websocket.send_text(refusal_text(error))
                await self._websocket.close(CLOSE_CODES[error.code], close_reason(error))
