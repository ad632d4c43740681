"""A recording as one browser plays it: at any speed, forwards and back."""

import asyncio
import json
import time
from bisect import bisect_right
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import suppress
from typing import TypeVar

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Event
from race_server.core.rules.items import items
from race_server.errors import GatewayError, RaceError, WireError
from race_server.live.gateway.audience import (
    LOT,
    POSITION,
    PROGRAMME,
    RAYS,
    SNAPSHOT,
    STANDINGS,
    TELEMETRY,
    Viewer,
)
from race_server.live.gateway.frames import RecordedEventFrames, event_frames, frame_of
from race_server.live.gateway.limits import GatewayTiming
from race_server.live.gateway.rays import RayCaster
from race_server.live.gateway.requests import Request
from race_server.net.wire.alert import decode_alerts
from race_server.net.wire.ghosts import decode_ghosts
from race_server.net.wire.line import encode_line
from race_server.net.wire.lobby import encode_course, encode_rules
from race_server.net.wire.parking import LotFrame, decode_lot
from race_server.net.wire.programme import decode_programme
from race_server.net.wire.rays import encode_rays
from race_server.net.wire.sheets import course_sheet, line_sheet, rules_sheet
from race_server.net.wire.spectate import SnapshotFrame, decode_snapshot, decode_standings
from race_server.net.wire.telemetry import decode_telemetries
from race_server.storage.recording.channels import ALERTS as ALERT_LINES
from race_server.storage.recording.channels import GHOSTS, LOTS, PROGRAMMES, SNAPSHOTS
from race_server.storage.recording.channels import STANDINGS as TABLES
from race_server.storage.recording.channels import TELEMETRY as TELEMETRY_LINES
from race_server.storage.recording.scenario_codec import unpack_scenario
from race_server.storage.recording.seekable import Moment, SeekableRecording

Answer = TypeVar("Answer")

# What is driven against stands within the first ticks of a recording.
FIRST_TICKS = TICKS_PER_SECOND


class Player:
    """Plays one recording to one viewer."""

    def __init__(
        self,
        viewer: Viewer,
        recording: SeekableRecording,
        events: list[Event],
        pool: Executor,
        timing: GatewayTiming,
    ) -> None:
        """Begin at the first tick. events: all of the race; pool: for blocking work."""
        self._viewer, self._recording, self._events = viewer, recording, events
        self._pool, self._timing = pool, timing
        self._ticks = [event.tick for event in events]
        self._event_frames = RecordedEventFrames(recording.start.epoch, events)
        self._tick = 0  # sent last
        self._anchor = (0.0, 0.0)  # a tick and the time at which it was due
        self._speed, self._is_playing = 1.0, False
        self._sought: int | None = 0
        self._changed = asyncio.Event()
        self._position_at = self._cast_at = 0.0
        self._snapshot: SnapshotFrame | None = None
        self._caster: RayCaster | None = None
        self._has_lot = self._is_of_event = False
        self._has_real_karts = any(row.is_tracked for row in recording.start.seats)
        self._lot: LotFrame | None = None  # of a car park

    def handle(self, request: Request) -> None:
        """Do what a browser asks for, one of PLAYER_REQUESTS."""
        kind = request["type"]
        if kind == "play":
            self._speed = request["speed"]
            if self._sought is None and self._tick >= self._recording.last_tick:
                self._sought = 0
            self._is_playing = True
        elif kind == "pause":
            self._is_playing = False
        elif kind == "seek":
            self._sought = request["tick"]
        else:
            self._is_playing = False
            self._sought = (self._tick if self._sought is None else self._sought) + request["ticks"]
        self._anchor = (float(self._tick), time.monotonic())
        if self._sought is None:
            self._send_position()  # a pause has no other answer
        self._changed.set()

    async def run(self) -> None:
        """Play until cancelled."""
        try:
            for data in await self._run_in_pool(self._first_messages):
                self._viewer.outbox.send(data)
            while True:
                if self._sought is not None:
                    sought, self._sought = self._sought, None
                    await self._jump(min(max(sought, 0), self._recording.last_tick))
                elif self._is_playing:
                    await self._advance()
                await self._wait()
        finally:
            self._recording.close()

    async def _wait(self) -> None:
        """Wait until the next snapshot is due, or the browser asks for something."""
        if self._sought is None:
            if not self._is_playing:
                self._send_rays()
            with suppress(TimeoutError):
                async with asyncio.timeout(1.0 / self._viewer.rate if self._is_playing else None):
                    await self._changed.wait()
        self._changed.clear()

    def _first_messages(self) -> list[bytes]:
        """Return the first messages: course, rules and line; runs in the pool."""
        start = self._recording.start
        try:
            scenario = unpack_scenario(start.setting, start.arrays)
            course = course_sheet(scenario)
            self._has_lot = scenario.course.lot is not None
            self._is_of_event = scenario.occasion is not None
            self._caster = RayCaster(course, scenario.lidar, scenario.radar)
            sheets = [
                encode_course(course),
                encode_rules(rules_sheet(scenario), [item.name for item in items()]),
                encode_line(line_sheet(scenario)),
            ]
        except RaceError as error:
            raise GatewayError("no-recording", str(error)) from error
        # Whatever a setting with words of other kinds makes sensors and messages trip over.
        except Exception as error:
            raise GatewayError(
                "no-recording",
                f"the recording cannot be played ({type(error).__name__}: {error}); it is damaged",
            ) from error
        ghosts = self._recording.newest(GHOSTS, FIRST_TICKS) if self._is_of_event else None
        return [*sheets, *([ghosts.data] if ghosts and _is_sound(decode_ghosts, ghosts) else [])]

    async def _jump(self, tick: int) -> None:
        """Send the state at a tick, and all events until then."""
        self._tick = tick  # a step that is asked for meanwhile counts from here
        table, programme, lot, alerts, told, snapshot, events = await self._run_in_pool(
            lambda: (
                self._recording.newest(TABLES, tick),
                self._recording.newest(PROGRAMMES, tick) if self._is_of_event else None,
                self._recording.newest(LOTS, tick) if self._has_lot else None,
                self._recording.newest(ALERT_LINES, tick) if self._has_real_karts else None,
                self._recording.newest(TELEMETRY_LINES, tick) if self._has_real_karts else None,
                self._recording.newest(SNAPSHOTS, tick),
                self._event_frames.frames(bisect_right(self._ticks, tick)),
            )
        )
        self._anchor = (float(tick), time.monotonic())
        outbox = self._viewer.outbox
        outbox.drop_newest()  # of where it was: it would be sent last
        self._send_position(sought=True)
        if table is not None and _is_sound(decode_standings, table):
            outbox.send(table.data)
        if programme is not None and _is_sound(decode_programme, programme):
            outbox.send(programme.data)
        if lot is not None and self._decode_lot(lot):
            outbox.send(lot.data)
        if alerts is not None and _is_sound(decode_alerts, alerts):
            outbox.send(alerts.data)
        if told is not None and _is_sound(decode_telemetries, told):
            outbox.send(told.data)
        for frame in events:
            outbox.send_frame(frame)
        if snapshot is not None and self._decode_snapshot(snapshot):
            outbox.send(snapshot.data)

    async def _advance(self) -> None:
        """Send what was recorded since the last time."""
        begun, at = self._anchor
        due = int(begun + (time.monotonic() - at) * TICKS_PER_SECOND * self._speed)
        last = min(due, self._recording.last_tick)
        before, self._tick = self._tick, max(last, self._tick)
        found = await self._run_in_pool(lambda: self._recording.between(before, last))
        if self._sought is not None:
            return  # the browser has sought another tick meanwhile
        self._send_between(found, before, last)
        if last >= self._recording.last_tick:
            self._is_playing = False
            self._send_position()
        elif time.monotonic() - self._position_at > self._timing.position_s:
            self._send_position()

    def _send_between(self, found: list[Moment], before: int, last: int) -> None:
        outbox, newest = self._viewer.outbox, {moment.kind: moment for moment in found}
        first, end = bisect_right(self._ticks, before), bisect_right(self._ticks, last)
        for frame in event_frames(self._recording.start.epoch, self._events[first:end]):
            outbox.send_frame(frame)
        table, snapshot, lot = newest.get(TABLES), newest.get(SNAPSHOTS), newest.get(LOTS)
        if table is not None and _is_sound(decode_standings, table):
            outbox.send_newest(STANDINGS, frame_of(table.data))
        programme = newest.get(PROGRAMMES)
        if programme is not None and _is_sound(decode_programme, programme):
            outbox.send_newest(PROGRAMME, frame_of(programme.data))
        if lot is not None and self._decode_lot(lot):
            outbox.send_newest(LOT, frame_of(lot.data))
        told = newest.get(TELEMETRY_LINES)
        if told is not None and _is_sound(decode_telemetries, told):
            outbox.send_newest(TELEMETRY, frame_of(told.data))
        # Each of them: at a high speed a short one would be missed.
        for alerts in (moment for moment in found if moment.kind is ALERT_LINES):
            if _is_sound(decode_alerts, alerts):
                outbox.send(alerts.data)
        if snapshot is not None and self._decode_snapshot(snapshot):
            outbox.send_newest(SNAPSHOT, frame_of(snapshot.data))
            self._send_rays()

    def _decode_snapshot(self, moment: Moment) -> bool:
        try:
            self._snapshot = decode_snapshot(moment.data)
        except WireError:
            return False
        return True

    def _decode_lot(self, moment: Moment) -> bool:
        try:
            self._lot = decode_lot(moment.data)
        except WireError:
            return False
        return True

    def _send_rays(self) -> None:
        now, viewer = time.monotonic(), self._viewer
        if not viewer.wants_rays or now - self._cast_at < self._timing.rays_s:
            return
        self._cast_at = now
        if self._snapshot is not None and self._caster is not None:
            if rays := self._caster.cast(self._snapshot, viewer.seat, self._lot):
                viewer.outbox.send_newest(RAYS, frame_of(encode_rays(rays)))

    def _send_position(self, *, sought: bool = False) -> None:
        self._position_at = time.monotonic()
        message = {
            "type": "position",
            "tick": self._tick,
            "first": 0,
            "last": self._recording.last_tick,
            "playing": self._is_playing,
            "speed": self._speed,
            "sought": sought,
        }
        frame = frame_of(json.dumps(message))
        # The page forgets its state after a seek, so this one must arrive, and in order.
        if sought:
            self._viewer.outbox.send_frame(frame)
        else:
            self._viewer.outbox.send_newest(POSITION, frame)

    def refresh(self) -> None:
        """Send what the viewer wants to see by now."""
        self._changed.set()

    async def _run_in_pool(self, read: Callable[[], Answer]) -> Answer:
        return await asyncio.get_running_loop().run_in_executor(self._pool, read)


def _is_sound(decode: Callable[[bytes], object], moment: Moment) -> bool:
    """Return whether a message can be sent on: a recording may come from anywhere."""
    try:
        decode(moment.data)
    except WireError:
        return False
    return True
