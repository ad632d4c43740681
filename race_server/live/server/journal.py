"""The part of a live race that is recorded."""

from collections.abc import Container
from functools import partial

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Event
from race_server.net.wire import topics
from race_server.net.wire.journal import StartFrame
from race_server.net.wire.spectate import decode_snapshot, encode_events
from race_server.net.wire.topics import Topic
from race_server.session.session import Session
from race_server.storage.queue import Ticket
from race_server.storage.recording.channels import (
    ALERTS,
    EVENTS,
    GHOSTS,
    LOTS,
    PROGRAMMES,
    SCENE,
    SNAPSHOTS,
    STANDINGS,
    TELEMETRY,
)
from race_server.storage.recording.header import header_of
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording
from race_server.storage.recording.recorder import Recorder
from race_server.storage.recording.scene import SCENE_TICKS, course_scene, karts_scene


class Journal:
    """The recording of one race while it is driven."""

    def __init__(
        self, logbook: Logbook, session: Session, frame: StartFrame, recorder: Recorder
    ) -> None:
        """Write through `recorder`, which `logbook` gave."""
        self._logbook = logbook
        self._session = session
        self._frame = frame
        self._recorder = recorder
        self._ghosts = b""  # that are in the recording
        self._names = {row.number: row.driver for row in frame.seats}
        vehicle = session.scenario.vehicle_of(0)
        self._size = (vehicle.length, vehicle.width)
        session.journal.is_recorded = True

    @classmethod
    def of_new_race(
        cls, logbook: Logbook, session: Session, pace: str, started_at: str, locals_: Container[int]
    ) -> "Journal | None":
        """Begin the recording of a race that has just been started; None if it cannot be."""
        frame = header_of(session, pace, started_at, locals_)
        recorder = logbook.begin(frame)
        if recorder is None:
            return None
        journal = cls(logbook, session, frame, recorder)
        # What was decided before the race began, and still holds.
        for act in session.seats.closings(session.tick):
            session.journal.add(act)
        for granted in session.replay_guard.granted(session.tick):
            session.journal.add(granted)
        recorder.record(session.journal.drain())
        borders, at = session.scenario.course.borders, recorder.time_of(0)
        recorder.write(SCENE, 0, partial(course_scene, borders, at))
        return journal

    @classmethod
    def of_old_race(
        cls, logbook: Logbook, session: Session, recording: Recording
    ) -> "Journal | None":
        """Continue the recording of a race whose server was killed; None if it cannot be."""
        recorder = logbook.begin(recording.start, takes_up=True)
        return None if recorder is None else cls(logbook, session, recording.start, recorder)

    def record(self, before: int, events: list[Event]) -> None:
        """Write the inputs and events since the last call. before: tick before the last advance."""
        session, recorder = self._session, self._recorder
        recorder.record(session.journal.drain())
        for lap in session.event_log.laps.laps_in(events):
            recorder.record_lap(lap)
        if events:
            recorder.write(EVENTS, session.tick, partial(encode_events, session.epoch, events))
        if before // TICKS_PER_SECOND != session.tick // TICKS_PER_SECOND:
            recorder.record_digest(session.tick, session.digest())

    def publish(self, topic: Topic, payload: bytes) -> None:
        """Write a snapshot or the standings, as spectators are sent them.

        Events are written as they happen, before they are published: see `record`.
        """
        recorder, tick = self._recorder, self._session.tick
        if topic is topics.SNAPSHOT:
            recorder.write(SNAPSHOTS, tick, payload)
            if tick % SCENE_TICKS == 0:
                recorder.write(SCENE, tick, partial(self._draw, payload, recorder.time_of(tick)))
        elif topic is topics.STANDINGS:
            recorder.write(STANDINGS, tick, payload)
        elif topic is topics.LOT:
            recorder.write(LOTS, tick, payload)
        elif topic is topics.ALERTS:
            recorder.write(ALERTS, tick, payload)
        elif topic is topics.TELEMETRIES:
            recorder.write(TELEMETRY, tick, payload)
        elif topic is topics.PROGRAMME:
            recorder.write(PROGRAMMES, tick, payload)
        elif topic is topics.GHOSTS and payload != self._ghosts:
            self._ghosts = payload
            recorder.write(GHOSTS, tick, payload)

    def _draw(self, snapshot: bytes, at: int) -> bytes:
        """Return a snapshot as a scene. at: time [ns since 1970]."""
        return karts_scene(decode_snapshot(snapshot), self._names, self._size, at)

    def flush(self) -> Ticket:
        """Request that all records so far be written; return the ticket of the request."""
        return self._recorder.flush()

    @property
    def backlog(self) -> int:
        """How many messages wait for the disk."""
        return self._recorder.backlog

    def close(self) -> None:
        """Write the last digest and close the recording."""
        session = self._session
        self._recorder.record(session.journal.drain())
        self._recorder.record_digest(session.tick, session.digest(), is_last=True)
        session.journal.is_recorded = False
        self._logbook.end(self._recorder, self._frame)
