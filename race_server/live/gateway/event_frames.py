"""The events of a race as frames: written once, however many newcomers want to know them all."""

from collections import deque

from race_server.core.messages import Event
from race_server.live.gateway.connection import frame_of
from race_server.net.wire.spectate import encode_events

# So many events go into one message, and so many whole messages are remembered.
EVENTS_AT_ONCE, MOST_WHOLE = 1024, 8


class EventFrames:
    """What has happened in one race, oldest first; the oldest is forgotten where it gets long."""

    def __init__(self, epoch: int) -> None:
        """Begin with nothing."""
        self._epoch = epoch
        self._whole: deque[bytes] = deque(maxlen=MOST_WHOLE)
        self._rest: list[Event] = []
        self._rest_frames: list[bytes] | None = []  # None where it has changed

    def add(self, events: list[Event]) -> None:
        """Write down what has happened."""
        self._rest += events
        while len(self._rest) >= EVENTS_AT_ONCE:
            self._whole += event_frames(self._epoch, self._rest[:EVENTS_AT_ONCE])
            del self._rest[:EVENTS_AT_ONCE]
        self._rest_frames = None

    def frames(self) -> list[bytes]:
        """Return all of it."""
        if self._rest_frames is None:
            self._rest_frames = event_frames(self._epoch, self._rest)
        return [*self._whole, *self._rest_frames]


class KnownEvents:
    """All events of a recording, of which so many as had happened are told at each leap."""

    def __init__(self, epoch: int, events: list[Event]) -> None:
        """Keep them, oldest first."""
        self._epoch, self._events = epoch, events
        self._whole: list[bytes] = []

    def frames(self, count: int) -> list[bytes]:
        """Return the first so many."""
        whole = count // EVENTS_AT_ONCE
        for number in range(len(self._whole), whole):
            self._whole += self._between(number * EVENTS_AT_ONCE, (number + 1) * EVENTS_AT_ONCE)
        return [*self._whole[:whole], *self._between(whole * EVENTS_AT_ONCE, count)]

    def _between(self, first: int, end: int) -> list[bytes]:
        return event_frames(self._epoch, self._events[first:end])


def event_frames(epoch: int, events: list[Event]) -> list[bytes]:
    """Return events as frames of a bounded size."""
    return [
        frame_of(encode_events(epoch, events[first : first + EVENTS_AT_ONCE]))
        for first in range(0, len(events), EVENTS_AT_ONCE)
    ]
