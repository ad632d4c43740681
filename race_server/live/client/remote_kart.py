"""One kart on a live server, as an environment keeps it, and the events of its race."""

import math
import threading
from typing import Any

import numpy as np

from race_server.core import codes
from race_server.core.messages import Button, Control, Event, EventKind
from race_server.core.observation import Observation
from race_server.core.state import Float32s, Floats
from race_server.core.vehicles import vehicle_record
from race_server.envs.actions import MEMORY, Driven, discrete_table, read_action
from race_server.envs.racing import reward_terms
from race_server.envs.racing.reward_terms import TERMS
from race_server.errors import WireError
from race_server.live.client.event_stream import EventStream
from race_server.live.client.seat import ClientSeat
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.spectate import decode_events

# What an event adds to which term.
_COUNTED = {
    EventKind.CONTACT_KART: reward_terms.CONTACT,
    EventKind.CONTACT_WALL: reward_terms.WALL,
    EventKind.USE: reward_terms.ITEM,
    EventKind.FINISH: reward_terms.FINISH,
}
_ENDS = frozenset({EventKind.FINISH, EventKind.RETIRED})
# Events that are remembered.
MAX_EVENTS = 4096


class RemoteKart:
    """One of the environment's seats: what it saw, what it answered, what happened to it."""

    seen: Observation  # newest
    before: Observation  # when the newest control was sent

    def __init__(self, seat: ClientSeat) -> None:
        briefing = seat.welcome.briefing
        self.seat = seat
        self.epoch = seat.welcome.epoch  # of the race before; the next one is ours
        self.events: list[Event] = []
        self._vehicle = vehicle_record(briefing.vehicle)[0]
        self._table = discrete_table()
        self._control = Control()
        self._commanded: Floats = np.zeros(4)

    @property
    def is_done(self) -> bool:
        """Whether the race is over for this kart."""
        return self.seen.scalar("finished") > 0.0

    def info(self) -> dict[str, Any]:
        """Return an agent's info: its seat and the tick of its observation."""
        return {"seat": self.seat.number, "tick": self.seen.tick}

    def begin(self, timeout_s: float) -> bool:
        """Wait for the first observation of a new race; False if there is none yet."""
        frame = self.seat.receive(timeout_s)
        if frame is None or frame.epoch <= self.epoch:
            return False
        self.epoch, self._sequence = frame.epoch, frame.acknowledged
        self.seen = self.before = Observation(frame.tick, self.seat.layout, frame.values)
        self.events.clear()
        # What the meaning of an action depends on: speed, last button, last controls.
        self._buttons = 0
        self._memory: Floats = np.zeros(MEMORY)
        self._off_track = 0.0
        self.is_late = False  # out because time ran out
        return True

    def receive(self, timeout_s: float) -> bool:
        """Wait for an observation of a later tick; False if there is none yet."""
        frame = self.seat.receive(timeout_s)
        if frame is None or frame.epoch != self.epoch:
            return False
        if frame.tick <= self.seen.tick:
            self._send()  # the same tick again: our answer was lost
            return False
        self.seen = Observation(frame.tick, self.seat.layout, frame.values)
        return True

    def answer(self, kind: int, given: Float32s) -> None:
        """Answer the newest observation with what an action means. given: (A,), of that kind."""
        wanted, now = self._commanded, self.seen.scalar
        kart = Driven(now("speed"), self._buttons, int(now("rescue_offered")))
        read_action(kind, given, self._table, kart, self._vehicle, self._memory, wanted)
        self._buttons = int(wanted[3])
        self._control = Control(wanted[0], wanted[1], wanted[2], Button(int(wanted[3])))
        self.before = self.seen
        self._send()

    def _send(self) -> None:
        self._sequence += 1
        self.seat.answer(self.epoch, self._sequence, self.seen.tick, self._control)

    def measure(self, course_length: float) -> Floats:
        """Return what every reward term of the last decision is, as `envs/reward_terms.py` does."""
        terms = np.zeros(len(TERMS))
        if self.seen is self.before:
            return terms  # the observation was lost: nothing is known of this decision
        now, before = self.seen.scalar, self.before.scalar
        terms[reward_terms.SPEED] = now("speed")
        terms[reward_terms.WRONG_WAY] = now("wrong_way")
        terms[reward_terms.PLACES] = before("rank") - now("rank")
        terms[reward_terms.LAP] = now("lap") - before("lap")
        terms[reward_terms.TIME] = 1.0
        self._count_events(terms)
        if "progress" in self.seat.layout.slices:
            gained = now("progress") - before("progress")
            terms[reward_terms.PROGRESS] = math.remainder(gained, course_length)
        if "lidar" in self.seat.layout.slices and not terms[reward_terms.CRASH]:
            terms[reward_terms.RANGE] = self._nearest_range()
        return terms

    def _nearest_range(self) -> float:
        ranges, reach = self.seen["lidar"], self.seat.welcome.briefing.lidar_reach
        return float(np.min(ranges, initial=reach, where=ranges > 0.0))

    def _count_events(self, terms: Floats) -> None:
        past = [event for event in self.events if event.tick < self.seen.tick]
        self.events = [event for event in self.events if event.tick >= self.seen.tick]
        for event in past:
            if event.kind in _COUNTED:
                terms[_COUNTED[event.kind]] += 1.0
            elif event.kind is EventKind.OFF_TRACK:
                self._off_track = float(event.value)
            elif event.kind is EventKind.RETIRED:
                terms[reward_terms.CRASH] = 1.0 if event.other == codes.CRASH else 0.0
                self.is_late = event.other == codes.TIME_OUT
        terms[reward_terms.OFF_TRACK] = self._off_track


class RaceEvents:
    """The events of one race, each once, whichever way they arrive."""

    def __init__(self, link: ClientLink) -> None:
        """Begin to receive; events count from `begin` on."""
        self._changed = threading.Condition()
        self._stream = EventStream(MAX_EVENTS)
        self.begin(-1)
        link.listen(topics.EVENTS, self.receive)

    def begin(self, epoch: int) -> None:
        """Forget the race before."""
        with self._changed:
            self._stream.begin(epoch)
            self._new: list[Event] = []
            self._ended: set[int] = set()  # seats whose race is over

    def receive(self, data: bytes) -> None:
        """Record the events of a message; those of another race do not count."""
        try:
            epoch, events = decode_events(data)
        except WireError:
            return
        with self._changed:
            if epoch != self._stream.epoch:
                return
            fresh = self._stream.receive(epoch, events)
            self._new += fresh
            self._ended |= {event.kart for event in fresh if event.kind in _ENDS}
            self._changed.notify_all()

    def wait_for(self, ended: set[int], timeout_s: float) -> list[Event]:
        """Return the new events, once it is known how the race ended for the seats `ended`."""
        with self._changed:
            self._changed.wait_for(lambda: ended <= self._ended, timeout_s)
            new, self._new = self._new, []
            return new
