"""A race live in Foxglove: what a spectator receives, forwarded over a WebSocket.

The channels are those of a recording, so a layout made for one fits the other. All work is done in
the spectator's process: to the server it is one more spectator.
"""

import threading
import time
from typing import Any, Self

from race_server.core.clock import TICKS_PER_SECOND
from race_server.errors import LinkError, RaceError
from race_server.live.client.spectator import Spectator
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.storage.recording.channels import EVENTS, SCENE, SNAPSHOTS, STANDINGS, ChannelKind
from race_server.storage.recording.scene import SCENE_TICKS, course_scene, karts_scene

PERIOD_S = SCENE_TICKS / TICKS_PER_SECOND
# Messages that wait for a slow viewer; beyond that the oldest are dropped.
MAX_WAITING = 256
_FORWARDED = ((topics.SNAPSHOT, SNAPSHOTS), (topics.EVENTS, EVENTS), (topics.STANDINGS, STANDINGS))


class FoxgloveServer:
    """Serves Foxglove on a port of this machine for as long as it is open."""

    def __init__(self, link: ClientLink, spectator: Spectator, session: str, port: int) -> None:
        """Serve viewers. port: 0 for any free one.

        Raises:
            RaceError: the extra is not installed.
            LinkError: the port is in use, or the server does not answer.
        """
        try:
            import foxglove
        except ImportError as error:
            raise RaceError(
                "Foxglove needs the package foxglove-sdk: pip install 'race-server[foxglove]'"
            ) from error
        self._sdk, self._context = foxglove, foxglove.Context()
        self._spectator = spectator
        rules, _ = spectator.rules()
        self._size = float(rules["kart_length"]), float(rules["kart_width"])
        self._borders = spectator.course().borders
        self._course_wanted = threading.Event()
        self._course_wanted.set()
        self._shown = (-1, -1)  # epoch and tick of the newest picture
        self._scene = self._channel(SCENE, session)
        self._ended = threading.Event()
        listener: Any = self  # the package calls those methods of a listener that exist
        try:
            self._server = foxglove.start_server(
                name=f"race {session}",
                host="127.0.0.1",
                port=port,
                server_listener=listener,
                context=self._context,
                message_backlog_size=MAX_WAITING,
            )
        except (OSError, RuntimeError) as error:
            raise LinkError(f"port {port} is in use; choose another, or 0 for any") from error
        for topic, kind in _FORWARDED:
            link.listen(topic, self._channel(kind, session).log)
        self._thread = threading.Thread(target=self._draw, name="foxglove", daemon=True)
        self._thread.start()

    def _channel(self, kind: ChannelKind, session: str) -> Any:
        schema = self._sdk.Schema(
            name=kind.schema_name, encoding=kind.schema_encoding, data=kind.schema_data
        )
        return self._sdk.Channel(
            f"race/{session}/{kind.key}",
            schema=schema,
            message_encoding=kind.encoding,
            context=self._context,
        )

    @property
    def address(self) -> str:
        """The address to open in Foxglove."""
        return f"ws://127.0.0.1:{self._server.port}"

    def on_subscribe(self, client: object, channel: object) -> None:
        """Draw the course again for a new viewer; called by a thread of the SDK."""
        del client, channel
        self._course_wanted.set()

    def on_unsubscribe(self, client: object, channel: object) -> None:
        """Do nothing; called by a thread of the SDK."""

    def _draw(self) -> None:
        while not self._ended.wait(PERIOD_S):
            now_ns = time.time_ns()
            if self._course_wanted.is_set():
                self._course_wanted.clear()
                self._scene.log(course_scene(self._borders, now_ns))
            frame = self._spectator.snapshot()
            if frame is None or (frame.epoch, frame.tick) == self._shown:
                continue
            self._shown = frame.epoch, frame.tick
            table = self._spectator.standings
            names = {row.seat: row.driver for row in table.rows} if table else {}
            self._scene.log(karts_scene(frame, names, self._size, now_ns))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Disconnect all viewers and stop."""
        self._ended.set()
        self._thread.join()
        self._server.stop()
