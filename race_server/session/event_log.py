"""What has happened in a race so far: its events and its laps."""

from collections import deque

from race_server.core.messages import Event, EventKind, Phase
from race_server.core.state import World

# Late joiners are told of so many events.
RECENT_EVENTS = 256


class EventLog:
    """The newest events of a session and all lap times of its race."""

    def __init__(self) -> None:
        """Begin before anything has happened."""
        self.recent: deque[Event] = deque(maxlen=RECENT_EVENTS)
        self.laps_us: dict[int, list[int]] = {}  # by seat

    def begin(self, seats: int) -> None:
        """Forget the last race."""
        self.recent.clear()
        self.laps_us = {seat: [] for seat in range(seats)}

    def take(self, world: World) -> list[Event]:
        """Return the events of the world since the last call and remember them."""
        count = int(world.event_counts[0])
        events = [
            Event(
                int(row.sequence),
                int(row.tick),
                EventKind(row.kind),
                int(row.kart),
                int(row.other),
                int(row.value),
            )
            for row in world.events[0][:count]
        ]
        world.event_counts[0] = 0
        for event in events:
            if event.kind is EventKind.LAP:
                self.laps_us[event.kart].append(event.value)
        self.recent.extend(events)
        return events

    def turn(self, world: World, phase: Phase) -> Event:
        """Remember that a phase begins, and return that as an event."""
        race = world.races[0]
        race.sequence += 1
        event = Event(int(race.sequence), int(race.tick), EventKind.PHASE, -1, int(phase), 0)
        self.recent.append(event)
        return event
