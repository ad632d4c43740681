"""One kart on a live server, as an environment keeps it, and the news of its race."""

import math
import threading
from typing import Any

import numpy as np

from race_server.core import codes
from race_server.core.messages import Button, Control, Event, EventKind
from race_server.core.observation import Observation
from race_server.core.state import Floats
from race_server.core.vehicles import vehicle_record
from race_server.envs.actions import MEMORY, WIDTHS, Driven, discrete_table, read_action
from race_server.envs.racing import reward_terms
from race_server.envs.racing.reward_terms import TERMS
from race_server.errors import WireError
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
# The event that says why a kart is through arrives close to its last observation.
NEWS_S = 1.0


class RemoteKart:
    """One of our seats: what it saw, what it answered, what befell it."""

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
    def is_through(self) -> bool:
        """Whether the race is over for this kart."""
        return self.seen.scalar("finished") > 0.0

    def info(self) -> dict[str, Any]:
        """Return what an agent is told besides its observation."""
        return {"seat": self.seat.number, "tick": self.seen.tick}

    def begin(self, timeout_s: float) -> bool:
        """Wait for the first observation of a new race; False if there is none yet."""
        frame = self.seat.hear(timeout_s)
        if frame is None or frame.epoch <= self.epoch:
            return False
        self.epoch, self._sequence = frame.epoch, frame.acknowledged
        self.seen = self.before = Observation(frame.tick, self.seat.layout, frame.values)
        self.events.clear()
        # What an action's meaning depends on: speed, the button before, what was set before.
        self._buttons = 0
        self._memory: Floats = np.zeros(MEMORY)
        self._off_track = 0.0
        self.is_late = False  # out because time ran out
        return True

    def hear(self, timeout_s: float) -> bool:
        """Wait for an observation of a later tick; False if there is none yet."""
        frame = self.seat.hear(timeout_s)
        if frame is None or frame.epoch != self.epoch:
            return False
        if frame.tick <= self.seen.tick:
            self._say()  # the same tick again: our answer was lost, not unwanted
            return False
        self.seen = Observation(frame.tick, self.seat.layout, frame.values)
        return True

    def answer(self, kind: int, action: Any) -> None:
        """Answer the newest observation with what an action means."""
        numbers = np.nan_to_num(np.ravel(np.asarray(action, np.float32)))
        given = np.zeros(WIDTHS[kind], np.float32)
        given[: len(numbers)] = numbers
        wanted, now = self._commanded, self.seen.scalar
        kart = Driven(now("speed"), self._buttons, int(now("rescue_offered")))
        read_action(kind, given, self._table, kart, self._vehicle, self._memory, wanted)
        self._buttons = int(wanted[3])
        self._control = Control(wanted[0], wanted[1], wanted[2], Button(int(wanted[3])))
        self.before = self.seen
        self._say()

    def _say(self) -> None:
        self._sequence += 1
        self.seat.answer(self.epoch, self._sequence, self.seen.tick, self._control)

    def measure(self, course_length: float) -> Floats:
        """Return what every reward term of the last decision is, as `envs/reward_terms.py` does."""
        terms = np.zeros(len(TERMS))
        if self.seen is self.before:
            return terms  # lost: nothing is known of this decision
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
        if "lidar" in self.seat.layout.slices:
            terms[reward_terms.RANGE] = near = self._nearest_range()
            fair = reward_terms.REPORT_B_RANGE * near + reward_terms.REPORT_B_SPEED * now("speed")
            terms[reward_terms.REPORT_B] = (
                reward_terms.REPORT_B_CRASH if terms[reward_terms.CRASH] else fair
            )
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


class News:
    """The events of one race, each once, whichever way it came."""

    def __init__(self, link: ClientLink) -> None:
        self._changed = threading.Condition()
        self.begin(-1)
        link.listen(topics.EVENTS, self.put)

    def begin(self, epoch: int) -> None:
        """Forget the race before."""
        with self._changed:
            self._epoch, self._last = epoch, 0
            self._new: list[Event] = []
            self._through: set[int] = set()

    def put(self, data: bytes) -> None:
        """Note the events in a message that are not known yet."""
        try:
            epoch, events = decode_events(data)
        except WireError:
            return
        with self._changed:
            for event in events:
                if epoch == self._epoch and event.sequence > self._last:
                    self._last = event.sequence
                    self._new.append(event)
                    if event.kind in _ENDS:
                        self._through.add(event.kart)
            self._changed.notify_all()

    def take(self, through: set[int]) -> list[Event]:
        """Return what is new, once it is known how the race ended for the seats `through`."""
        with self._changed:
            self._changed.wait_for(lambda: through <= self._through, NEWS_S)
            new, self._new = self._new, []
            return new
