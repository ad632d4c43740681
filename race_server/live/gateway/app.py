"""What is served, and under which headers."""

from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from race_server.live.gateway.browser import BrowserSession
from race_server.live.gateway.hub import Hub
from race_server.live.gateway.origins import is_known_host
from race_server.live.gateway.page import ASSETS, File, Page

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]

HEADERS = {
    # Everything comes from here, and nothing is written into the page itself.
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
# Names of these files follow from what they hold.
FOR_EVER, NEVER = "public, max-age=31536000, immutable", "no-cache"
BEARER = "bearer "


class Guarded:
    """Puts the headers on every answer, and answers nobody who calls us by a foreign name."""

    def __init__(self, inner: Starlette, hub: Hub) -> None:
        """Stand before an application."""
        self._inner, self._hub = inner, hub

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Hand a request on."""
        if scope["type"] != "http":
            await self._inner(scope, receive, send)
            return

        async def send_on(message: Message) -> None:
            if message["type"] == "http.response.start":
                extra = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
                message["headers"] = [*message.get("headers", []), *extra]
            await send(message)

        settings = self._hub.settings
        host = Request(scope).headers.get("host", "")
        if settings.is_local and not is_known_host(host, settings.origins):
            refusal = PlainTextResponse("Open the page at the gateway's own address.\n", 403)
            await refusal(scope, receive, send_on)
            return
        await self._inner(scope, receive, send_on)


def make_app(hub: Hub, page: Page) -> Guarded:
    """Return the application."""

    async def meet(websocket: WebSocket) -> None:
        try:
            await BrowserSession(hub, websocket).serve()
        except WebSocketDisconnect:
            return  # it went while it was told something

    async def show(request: Request) -> Response:
        name = request.path_params.get("name")
        found = page.files.get(f"{ASSETS}/{name}" if name else "")
        if found is None:
            return PlainTextResponse("There is no such file.\n", 404)
        return _answer(found, request, FOR_EVER if name else NEVER)

    async def list_recordings(request: Request) -> Response:
        shown = request.headers.get("authorization", "")
        token = shown[len(BEARER) :] if shown.lower().startswith(BEARER) else ""
        if not hub.settings.tokens.lets_read(token):
            return PlainTextResponse("Show a token: Authorization: Bearer TOKEN\n", 401)
        return JSONResponse(await run_in_threadpool(hub.library.titles), headers=_fresh())

    async def tell_health(_: Request) -> Response:
        state = "a race is there" if hub.live.is_there else "no race yet"
        return PlainTextResponse(f"ok: {state}, {len(hub.guests)} browsers\n", headers=_fresh())

    routes = [
        Route("/", show),
        Route(f"/{ASSETS}/{{name}}", show),
        Route("/recordings", list_recordings),
        Route("/healthz", tell_health),
        WebSocketRoute("/ws", meet),
    ]
    return Guarded(Starlette(routes=routes), hub)


def _fresh() -> dict[str, str]:
    return {"cache-control": NEVER}


def _answer(file: File, request: Request, keep: str) -> Response:
    headers = {"cache-control": keep, "vary": "accept-encoding"}
    is_packed = bool(file.packed) and "gzip" in request.headers.get("accept-encoding", "")
    if is_packed:
        headers["content-encoding"] = "gzip"
    content = file.packed if is_packed else file.content
    return Response(content, media_type=file.kind, headers=headers)
