"""The HTTP routes of a gateway and the headers of its answers."""

from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from race_server.live.gateway.browser import BrowserSession
from race_server.live.gateway.origins import is_known_host
from race_server.live.gateway.page import ASSETS, File, Page
from race_server.live.gateway.settings import Settings
from race_server.live.gateway.state import GatewayState

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]

HEADERS = {
    # Everything is loaded from the gateway, and no script or style is inline.
    "content-security-policy": (
        "default-src 'self'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        "connect-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
# Asset names contain a digest of their content, so they never expire in a cache.
CACHED, NOT_CACHED = "public, max-age=31536000, immutable", "no-cache"
BEARER = "bearer "
NO_TOKEN = "Show a token: Authorization: Bearer TOKEN\n"
NO_BODY = "Leave out the body: no request here has one.\n"


class GuardedApp:
    """Adds the headers to every answer; refuses bodies, and requests for a foreign host name."""

    def __init__(self, inner: Starlette, settings: Settings) -> None:
        """Wrap an application."""
        self._inner, self._settings = inner, settings

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Pass a request on."""
        if scope["type"] != "http":
            await self._inner(scope, receive, send)
            return

        async def send_on(message: Message) -> None:
            if message["type"] == "http.response.start":
                extra = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
                message["headers"] = [*message.get("headers", []), *extra]
            await send(message)

        settings, headers = self._settings, Request(scope).headers
        if "transfer-encoding" in headers or headers.get("content-length", "0") != "0":
            # Where a body ends two programs may see differently, so none is read.
            refusal = PlainTextResponse(NO_BODY, 400, {"connection": "close"})
            await refusal(scope, receive, send_on)
            return
        host = headers.get("host", "")
        if settings.is_local and not is_known_host(host, settings.origins):
            refusal = PlainTextResponse("Open the page at the gateway's own address.\n", 403)
            await refusal(scope, receive, send_on)
            return
        await self._inner(scope, receive, send_on)


def make_app(state: GatewayState, page: Page) -> GuardedApp:
    """Return the application."""

    async def serve_browser(websocket: WebSocket) -> None:
        try:
            await BrowserSession(state, websocket).serve()
        except WebSocketDisconnect:
            return  # it left while a message was sent

    async def serve_file(request: Request) -> Response:
        name = request.path_params.get("name")
        found = page.files.get(f"{ASSETS}/{name}" if name else "")
        if found is None:
            return PlainTextResponse("There is no such file.\n", 404)
        return _answer(found, request, CACHED if name else NOT_CACHED)

    async def list_recordings() -> Response:
        return JSONResponse(await run_in_threadpool(state.library.titles), headers=_no_cache())

    async def tell_timing() -> Response:
        race = _results_of(state)["race"]
        if race is None:
            return PlainTextResponse("No race yet: ask again.\n", 503, {"retry-after": "1"})
        return JSONResponse(race, headers=_no_cache())

    async def tell_results() -> Response:
        return JSONResponse(_results_of(state), headers=_no_cache())

    async def report_health(_: Request) -> Response:
        race = "a race is there" if state.live.is_there else "no race yet"
        return PlainTextResponse(
            f"ok: {race}, {len(state.browsers)} browsers\n", headers=_no_cache()
        )

    routes = [
        Route("/", serve_file),
        Route(f"/{ASSETS}/{{name}}", serve_file),
        Route("/recordings", _for_readers(state, list_recordings)),
        Route("/timing", _for_readers(state, tell_timing)),
        Route("/results.json", _for_readers(state, tell_results)),
        Route("/healthz", report_health),
        WebSocketRoute("/ws", serve_browser),
    ]
    return GuardedApp(Starlette(routes=routes), state.settings)


def _for_readers(
    state: GatewayState, tell: Callable[[], Awaitable[Response]]
) -> Callable[[Request], Awaitable[Response]]:
    """Return what answers those who may read what spectators see."""

    async def answer(request: Request) -> Response:
        if not _may_read(request, state.settings):
            return PlainTextResponse(NO_TOKEN, 401)
        return await tell()

    return answer


def _results_of(state: GatewayState) -> dict[str, Any]:
    """Return race and event as they stand, None for what there is not."""
    view = state.live.view
    race, event = (view.standings, view.programme) if state.live.is_there else (None, None)
    return {"race": race and race.as_json(), "event": event and event.as_json()}


def _may_read(request: Request, settings: Settings) -> bool:
    shown = request.headers.get("authorization", "")
    token = shown[len(BEARER) :] if shown.lower().startswith(BEARER) else ""
    return settings.tokens.lets_read(token)


def _no_cache() -> dict[str, str]:
    return {"cache-control": NOT_CACHED}


def _answer(file: File, request: Request, keep: str) -> Response:
    headers = {"cache-control": keep, "vary": "accept-encoding"}
    is_packed = bool(file.packed) and "gzip" in request.headers.get("accept-encoding", "")
    if is_packed:
        headers["content-encoding"] = "gzip"
    content = file.packed if is_packed else file.content
    return Response(content, media_type=file.kind, headers=headers)
