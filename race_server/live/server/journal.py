"""The race server's hand that writes: what of a live race goes into its recording."""

from collections.abc import Container
from functools import partial

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Event, EventKind
from race_server.net.wire.journal import StartFrame
from race_server.net.wire.spectate import SnapshotFrame, encode_events
from race_server.session import Session
from race_server.storage.recording.channels import EVENTS, SCENE, SNAPSHOTS, STANDINGS
from race_server.storage.recording.header import header_of
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording
from race_server.storage.recording.recorder import Recorder
from race_server.storage.recording.scene import SCENE_TICKS, course_scene, karts_scene


class Journal:
    """The recording of one race while it is driven."""

    def __init__(self, logbook: Logbook, session: Session, frame: StartFrame, old: bool) -> None:
        """Begin a recording, or take up the old one."""
        self._logbook = logbook
        self._session = session
        self._frame = frame
        self._recorder: Recorder = logbook.begin(frame, takes_up=old)
        self._names = {row.number: row.driver for row in frame.seats}
        vehicle = session.scenario.vehicle_of(0)
        self._size = (vehicle.length, vehicle.width)
        session.is_recorded = True
        if not old:
            session.log_what_holds()
            self._recorder.note(session.log)
            borders, at = session.scenario.course.borders, self._recorder.time_of(0)
            self._recorder.write(SCENE, 0, partial(course_scene, borders, at))

    @classmethod
    def of_new_race(
        cls, logbook: Logbook, session: Session, pace: str, started_at: str, locals_: Container[int]
    ) -> "Journal":
        """Begin the recording of a race that has just been started."""
        return cls(logbook, session, header_of(session, pace, started_at, locals_), old=False)

    @classmethod
    def of_old_race(cls, logbook: Logbook, session: Session, recording: Recording) -> "Journal":
        """Go on with the recording of a race that is taken up."""
        return cls(logbook, session, recording.start, old=True)

    def note(self, before: int, events: list[Event]) -> None:
        """Write what acted since the last call and what came of it. before: tick at its start."""
        session, recorder = self._session, self._recorder
        recorder.note(session.log)
        for event in events:
            if event.kind is EventKind.LAP:
                recorder.note_lap(event.kart, event.other, event.value, event.tick)
        if events:
            told = partial(encode_events, session.epoch, events)
            recorder.write(EVENTS, session.tick, told)
        if before // TICKS_PER_SECOND != session.tick // TICKS_PER_SECOND:
            recorder.note_digest(session.tick, session.digest())

    def note_snapshot(self, frame: SnapshotFrame, data: bytes) -> None:
        """Write what spectators see."""
        self._recorder.write(SNAPSHOTS, frame.tick, data)
        if frame.tick % SCENE_TICKS == 0:
            at = self._recorder.time_of(frame.tick)
            drawn = partial(karts_scene, frame, self._names, self._size, at)
            self._recorder.write(SCENE, frame.tick, drawn)

    def note_standings(self, data: bytes) -> None:
        """Write the table."""
        self._recorder.write(STANDINGS, self._session.tick, data)

    def ticket(self) -> tuple[Recorder, int]:
        """Return what an announcement has to wait for."""
        return self._recorder, self._recorder.hurry()

    @property
    def backlog(self) -> int:
        """How many messages wait for the disk."""
        return self._recorder.backlog

    def end(self) -> None:
        """Write the last digest and close the recording."""
        session = self._session
        self._recorder.note(session.log)
        self._recorder.note_digest(session.tick, session.digest(), is_last=True)
        session.is_recorded = False
        self._logbook.end(self._recorder, self._frame)
