"""What has happened in a race so far: its events and its laps."""

from collections import deque

from race_server.core.messages import Event, EventKind, Phase
from race_server.core.state import World
from race_server.session.lap_log import LapLog

# Spectators that come late receive at most this many events.
RECENT_EVENTS = 256


class EventLog:
    """The newest events of a session and all laps of its race."""

    def __init__(self) -> None:
        """Begin with no events."""
        self.recent: deque[Event] = deque(maxlen=RECENT_EVENTS)
        self.laps = LapLog()

    def begin(self, seats: int) -> None:
        """Forget the last race. seats: how many there are."""
        self.recent.clear()
        self.laps.begin(seats)

    def collect(self, world: World) -> list[Event]:
        """Record the events of the world since the last call, and return them."""
        count = int(world.event_counts[0])
        events = [
            Event(
                int(row.sequence),
                int(row.tick),
                EventKind(row.kind),
                int(row.kart),
                int(row.other),
                int(row.value),
                int(row.detail),
            )
            for row in world.events[0][:count]
        ]
        world.event_counts[0] = 0
        for event in events:
            self.laps.add(event)
        self.recent.extend(events)
        return events

    def enter_phase(self, world: World, phase: Phase) -> Event:
        """Record that a phase begins, and return that as an event."""
        race = world.races[0]
        race.sequence += 1
        event = Event(int(race.sequence), int(race.tick), EventKind.PHASE, -1, int(phase), 0)
        self.recent.append(event)
        return event
