"""Whether the recording of a drill makes the race that was driven."""

from dataclasses import dataclass

from race_server.storage.recording.reader import Recording
from race_server.storage.recording.rerun import Rerun


@dataclass(frozen=True)
class Replay:
    """A recording that was driven again."""

    fault: str  # what follows "a recording ..."; "" where the races are equal
    digests: int  # that were compared and equal


def replay_of(recording: Recording, digest: str = "") -> Replay:
    """Drive a recorded race again and compare the two.

    digest: that of the race at its end, which the recording must reach; "" where it ends earlier.

    Raises:
        RecordingError: the recording does not fit this version.
    """
    rerun = Rerun(recording, is_blind=True)
    for _ in rerun.run():
        pass
    if rerun.difference is not None:
        return Replay(f"differs from tick {rerun.difference.tick} on", rerun.compared)
    if digest and not (recording.is_complete and rerun.session.digest() == digest):
        return Replay("ends with another digest than the race", rerun.compared)
    return Replay("", rerun.compared)
