"""Restoring a race whose server was killed."""

from race_server.core.messages import Event
from race_server.errors import RecordingError
from race_server.net.wire.spectate import decode_snapshot
from race_server.session.session import Session
from race_server.storage.recording.reader import Recording
from race_server.storage.recording.rerun import Rerun
from race_server.storage.results.keeper import Keeper


def restore_session(recording: Recording, keeper: Keeper | None) -> tuple[Session, list[Event]]:
    """Return the session as its server left it, and all events so far.

    The race is replayed from its recording; laps that are not yet in the results file are put
    there. Drivers count as away until their links are back.

    Raises:
        RecordingError: the recording makes no race, or another one than was recorded.
    """
    rerun = Rerun(recording, is_blind=True)
    session = rerun.session
    events = list(session.event_log.recent)
    if keeper:
        keeper.resume(session, recording.start.pace, recording.start.started_at)
    for happened in rerun.run():
        events += happened
        if keeper:
            keeper.add_laps(session.event_log.laps.laps_in(happened))
    if rerun.difference is not None:
        tick = rerun.difference.tick
        raise RecordingError(
            f"the race of recording {recording.path} cannot be taken up: driven again it differs "
            f"from tick {tick} on. Was it recorded with other versions of race-server or numba?"
        )
    _count_on(session, recording)
    for seat in session.seats:
        seat.away_since = session.tick if seat.is_taken else -1
    return session, events


def _count_on(session: Session, recording: Recording) -> None:
    """Continue each driver's sequence at the newest message acknowledged in the last snapshot."""
    if not recording.snapshot:
        return
    for kart in decode_snapshot(recording.snapshot).karts:
        seat = session.seats[kart["seat"]]
        seat.sequence = max(seat.sequence, int(kart["acknowledged"]))
