"""What has happened in a race so far: its events, its laps and its live timing."""

from collections import deque

from race_server.core.messages import Event, EventKind, Phase
from race_server.core.state import World
from race_server.session.lap_log import LapLog
from race_server.session.live_timing import LiveTiming, timing_of

# Spectators that come late receive at most this many events.
RECENT_EVENTS = 256


class EventLog:
    """The newest events of a session, and all laps of its race with their timing."""

    def __init__(self) -> None:
        """Begin with no events."""
        self.recent: deque[Event] = deque(maxlen=RECENT_EVENTS)
        self.laps = LapLog()
        self.timing: LiveTiming | None = None  # none in a car park
        self._tick = 0

    def begin(self, world: World) -> None:
        """Forget the last race; in this one all karts stand on the grid."""
        self.recent.clear()
        self.laps.begin(world.bodies.shape[1])
        self.timing = timing_of(world)
        self._tick = int(world.races[0].tick)

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
        if self.timing is not None:
            self.timing.follow(world, self._tick, events)
        self._tick = int(world.races[0].tick)
        return events

    def enter_phase(self, world: World, phase: Phase) -> Event:
        """Record that a phase begins, and return that as an event."""
        race = world.races[0]
        race.sequence += 1
        event = Event(int(race.sequence), int(race.tick), EventKind.PHASE, -1, int(phase), 0)
        self.recent.append(event)
        return event
