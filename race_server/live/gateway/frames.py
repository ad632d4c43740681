"""Messages as WebSocket frames: encoded once, sent to every browser."""

import json
from collections import deque

from websockets.frames import Frame, Opcode

from race_server.core.messages import Event
from race_server.net.wire.spectate import encode_events

# Events in one message, and whole messages that are remembered.
EVENTS_PER_FRAME, MAX_WHOLE_FRAMES = 1024, 8


def frame_of(payload: bytes | str) -> bytes:
    """Return a message as the bytes of a frame, the same for every browser."""
    if isinstance(payload, str):
        return Frame(Opcode.TEXT, payload.encode()).serialize(mask=False)
    return Frame(Opcode.BINARY, payload).serialize(mask=False)


def notice_frame(code: str, reason: str = "") -> bytes:
    """Return a notice as a frame."""
    return frame_of(json.dumps({"type": "notice", "code": code, "reason": reason}))


def event_frames(epoch: int, events: list[Event]) -> list[bytes]:
    """Return events as frames of a bounded size."""
    return [
        frame_of(encode_events(epoch, events[first : first + EVENTS_PER_FRAME]))
        for first in range(0, len(events), EVENTS_PER_FRAME)
    ]


class EventFrames:
    """The events of a race that goes on, oldest first; the oldest are forgotten."""

    def __init__(self, epoch: int) -> None:
        """Begin without events."""
        self.epoch = epoch
        self._whole: deque[bytes] = deque(maxlen=MAX_WHOLE_FRAMES)
        self._rest: list[Event] = []
        self._rest_frames: list[bytes] | None = []  # None where it has changed

    def add(self, events: list[Event]) -> None:
        """Append events."""
        self._rest += events
        while len(self._rest) >= EVENTS_PER_FRAME:
            self._whole += event_frames(self.epoch, self._rest[:EVENTS_PER_FRAME])
            del self._rest[:EVENTS_PER_FRAME]
        self._rest_frames = None

    def frames(self) -> list[bytes]:
        """Return all events as frames."""
        if self._rest_frames is None:
            self._rest_frames = event_frames(self.epoch, self._rest)
        return [*self._whole, *self._rest_frames]


class RecordedEventFrames:
    """The events of a recording, of which the first ones are sent after each seek."""

    def __init__(self, epoch: int, events: list[Event]) -> None:
        """Keep the events, oldest first."""
        self._epoch, self._events = epoch, events
        self._whole: list[bytes] = []

    def frames(self, count: int) -> list[bytes]:
        """Return the first `count` events as frames."""
        whole = count // EVENTS_PER_FRAME
        for number in range(len(self._whole), whole):
            self._whole += self._between(number * EVENTS_PER_FRAME, (number + 1) * EVENTS_PER_FRAME)
        return [*self._whole[:whole], *self._between(whole * EVENTS_PER_FRAME, count)]

    def _between(self, first: int, end: int) -> list[bytes]:
        return event_frames(self._epoch, self._events[first:end])
