"""A recording as one browser plays it: at its own speed, forwards and back."""

import asyncio
import json
import time
from bisect import bisect_right
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import suppress
from typing import Any, TypeVar

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Event
from race_server.core.rules.items import items
from race_server.errors import GatewayError, RecordingError, WireError
from race_server.live.gateway.audience import POSITION, RAYS, SNAPSHOT, STANDINGS, Viewer
from race_server.live.gateway.connection import frame_of
from race_server.live.gateway.event_frames import KnownEvents, event_frames
from race_server.live.gateway.handshake import read_int, read_number
from race_server.live.gateway.rays import Caster
from race_server.net.wire.line import encode_line
from race_server.net.wire.lobby import encode_course, encode_rules
from race_server.net.wire.rays import encode_rays
from race_server.net.wire.sheets import course_sheet, line_sheet, rules_sheet
from race_server.net.wire.spectate import SnapshotFrame, decode_snapshot, decode_standings
from race_server.storage.recording.channels import SNAPSHOTS
from race_server.storage.recording.channels import STANDINGS as TABLES
from race_server.storage.recording.scenario_codec import unpack_scenario
from race_server.storage.recording.seekable import Moment, SeekableRecording

Answer = TypeVar("Answer")

LEAST_SPEED, MOST_SPEED = 0.1, 16.0
MOST_TICK = 1 << 31
# Where it stands is told as often as this, and rays are cast as often as that [s].
TELL_S, RAYS_S = 0.5, 0.1
WORDS = ("play", "pause", "seek", "step")


class Player:
    """Plays one recording to one viewer."""

    def __init__(
        self, viewer: Viewer, tape: SeekableRecording, events: list[Event], pool: Executor
    ) -> None:
        """Stand at the beginning. events: all of the race; pool: for what has to wait."""
        self._viewer, self._tape, self._events, self._pool = viewer, tape, events, pool
        self._ticks = [event.tick for event in events]
        self._known = KnownEvents(tape.start.epoch, events)
        self._tick = 0  # shown last
        self._anchor = (0.0, 0.0)  # a tick and the time at which it was due
        self._speed, self._is_playing = 1.0, False
        self._sought: int | None = 0
        self._turned = asyncio.Event()
        self._told_at = self._cast_at = 0.0
        self._snapshot: SnapshotFrame | None = None
        self._caster: Caster | None = None

    def obey(self, words: dict[str, Any]) -> None:
        """Do what a browser asks for.

        Raises:
            GatewayError: it makes no sense.
        """
        kind = words["type"]
        if kind == "play":
            self._speed = read_number(words, "speed", LEAST_SPEED, MOST_SPEED, default=1.0)
            if self._tick >= self._tape.last_tick:
                self._sought = 0
            self._is_playing = True
        elif kind == "pause":
            self._is_playing = False
        elif kind == "seek":
            self._sought = read_int(words, "tick", 0, MOST_TICK, default=0)
        else:
            ticks = read_int(words, "ticks", -MOST_TICK, MOST_TICK, default=1)
            self._is_playing = False
            self._sought = (self._tick if self._sought is None else self._sought) + ticks
        self._anchor = (float(self._tick), time.monotonic())
        self._turned.set()

    async def run(self) -> None:
        """Play until the browser has gone."""
        try:
            for data in await self._wait_for(self._sheets):
                self._viewer.outbox.tell(data)
            while True:
                if self._sought is not None:
                    sought, self._sought = self._sought, None
                    await self._jump(min(max(sought, 0), self._tape.last_tick))
                elif self._is_playing:
                    await self._go_on()
                await self._wait()
        finally:
            self._tape.close()

    async def _wait(self) -> None:
        """Wait for the next picture, or for a word of the browser."""
        if self._sought is None:
            if not self._is_playing:
                self._show_rays()
            with suppress(TimeoutError):
                async with asyncio.timeout(1.0 / self._viewer.rate if self._is_playing else None):
                    await self._turned.wait()
        self._turned.clear()

    def _sheets(self) -> list[bytes]:
        """Return what comes first, as messages; runs in the pool."""
        start = self._tape.start
        try:
            scenario = unpack_scenario(start.setting, start.arrays)
        except RecordingError as error:
            raise GatewayError("no-recording", str(error)) from error
        course = course_sheet(scenario)
        self._caster = Caster(course, scenario.lidar, scenario.radar)
        names = [item.name for item in items()]
        return [
            encode_course(course),
            encode_rules(rules_sheet(scenario), names),
            encode_line(line_sheet(scenario)),
        ]

    async def _jump(self, tick: int) -> None:
        """Show a moment, and all that was known then."""
        table, snapshot, events = await self._wait_for(
            lambda: (
                self._tape.newest(TABLES, tick),
                self._tape.newest(SNAPSHOTS, tick),
                self._known.frames(bisect_right(self._ticks, tick)),
            )
        )
        self._tick, self._anchor = tick, (float(tick), time.monotonic())
        self._tell_position(sought=True)
        outbox = self._viewer.outbox
        if table is not None and _is_sound(decode_standings, table):
            outbox.tell(table.data)
        for frame in events:
            outbox.put(frame)
        if snapshot is not None and self._take_snapshot(snapshot):
            outbox.tell(snapshot.data)

    async def _go_on(self) -> None:
        """Show what has come since the last picture."""
        begun, at = self._anchor
        due = int(begun + (time.monotonic() - at) * TICKS_PER_SECOND * self._speed)
        last = min(due, self._tape.last_tick)
        before, self._tick = self._tick, max(last, self._tick)
        shown = await self._wait_for(lambda: self._tape.between(before, last))
        if self._sought is not None:
            return  # it was moved meanwhile
        self._show(shown, before, last)
        if last >= self._tape.last_tick:
            self._is_playing = False
            self._tell_position()
        elif time.monotonic() - self._told_at > TELL_S:
            self._tell_position()

    def _show(self, shown: list[Moment], before: int, last: int) -> None:
        outbox, newest = self._viewer.outbox, {moment.kind: moment for moment in shown}
        first, end = bisect_right(self._ticks, before), bisect_right(self._ticks, last)
        for frame in event_frames(self._tape.start.epoch, self._events[first:end]):
            outbox.put(frame)
        table, snapshot = newest.get(TABLES), newest.get(SNAPSHOTS)
        if table is not None and _is_sound(decode_standings, table):
            outbox.show(STANDINGS, frame_of(table.data))
        if snapshot is not None and self._take_snapshot(snapshot):
            outbox.show(SNAPSHOT, frame_of(snapshot.data))
            self._show_rays()

    def _take_snapshot(self, moment: Moment) -> bool:
        try:
            self._snapshot = decode_snapshot(moment.data)
        except WireError:
            return False
        return True

    def _show_rays(self) -> None:
        now, viewer = time.monotonic(), self._viewer
        if not viewer.wants_rays or now - self._cast_at < RAYS_S:
            return
        self._cast_at = now
        if self._snapshot is not None and self._caster is not None:
            if rays := self._caster.cast(self._snapshot, viewer.seat):
                viewer.outbox.show(RAYS, frame_of(encode_rays(rays)))

    def _tell_position(self, *, sought: bool = False) -> None:
        self._told_at = time.monotonic()
        words = {
            "type": "position",
            "tick": self._tick,
            "first": 0,
            "last": self._tape.last_tick,
            "playing": self._is_playing,
            "speed": self._speed,
            "sought": sought,
        }
        frame = frame_of(json.dumps(words))
        # The page forgets what it knew where it was moved, so that one must arrive, and in order.
        if sought:
            self._viewer.outbox.put(frame)
        else:
            self._viewer.outbox.show(POSITION, frame)

    def turn(self) -> None:
        """Look again at what the viewer wants."""
        self._turned.set()

    async def _wait_for(self, read: Callable[[], Answer]) -> Answer:
        return await asyncio.get_running_loop().run_in_executor(self._pool, read)


def _is_sound(decode: Callable[[bytes], object], moment: Moment) -> bool:
    """Return whether a message can be handed on: a recording may come from anywhere."""
    try:
        decode(moment.data)
    except WireError:
        return False
    return True
