"""Whether a parking driver sees and answers in a session what it does in training.

A recorded session is driven again beside a training world that starts alike and gets the same
controls. What each led vehicle sees has to be the same in both, and what a driver answers to the
training world has to be what acted in the session.
"""

from dataclasses import dataclass, replace

import numpy as np

from race_server.core.driver import Driver, driver_named
from race_server.core.observation import Observation
from race_server.core.state import Floats
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.parking import Parking
from race_server.envs.task import Task
from race_server.live.local_drivers import briefing_for
from race_server.scenario.race import line_up_race
from race_server.session.observations import Observations
from race_server.session.seats import Seat
from race_server.session.session import Session
from race_server.storage.recording.reader import Recording
from race_server.storage.recording.rerun import Rerun

# Numbers that differ by no more are the same but for rounding.
ROUNDING = 1e-5
# A driver that was just given the wheel may answer between two decisions of training: its answers
# count from then on.
SETTLED_TICKS = 15


@dataclass(frozen=True)
class Answers:
    """What was compared. Differences are the largest of all decisions."""

    decisions: int  # of all led vehicles
    seen: float  # between the observations of session and training world
    answered: float  # between the driver's answers to the training world and what acted
    apart: int  # answers that differ by more than ROUNDING


def compare_answers(recording: Recording, name: str) -> Answers:
    """Drive a recorded session again beside a training world and compare the two.

    name: the driver that parked, which answers only to what it observes.

    Raises:
        RecordingError: the recording does not fit this version.
        DriverError: there is no such driver.
    """
    rerun = Rerun(recording)
    batch = _training_world(rerun.session, driver_named(name).preset)
    pair = _Pair(rerun.session, batch, name)
    pair.look()
    for _ in rerun.run(most_ticks=1):
        pair.compare()
        batch.step(pair.acting())
        pair.look()
    batch.close()
    return Answers(pair.decisions, pair.most_seen, pair.most_answered, pair.apart)


class _Pair:
    """A session that is driven again, and the training world beside it."""

    def __init__(self, session: Session, batch: Batch, name: str) -> None:
        """Compare nothing yet. name: of the driver."""
        self._session, self._batch, self._name = session, batch, name
        self._seen = Observations(len(session.seats), session.scenario.lidar.rays)
        for seat in session.seats:
            self._seen.show(seat.number, batch.layout.preset)
        self._drivers: dict[int, Driver] = {}  # by seat
        self._since: dict[int, int] = {}  # by seat, the tick at which the driver was asked first
        self.decisions = self.apart = 0
        self.most_seen = self.most_answered = 0.0

    def look(self) -> None:
        """Keep what both show before a tick."""
        seats = range(len(self._session.seats))
        self._tick = self._session.tick
        self._seen.compute(self._session.world)
        self._live = [self._seen.of(seat).copy() for seat in seats]
        self._trained = self._batch.observations[0].copy()

    def acting(self) -> Floats:
        """Return the controls that acted in the session in its last tick, (K, 4)."""
        return np.stack([self._session.acting(seat.number) for seat in self._session.seats])

    def compare(self) -> None:
        """Compare what both showed before the session's last tick, and what acted in it."""
        if self._tick == 0 or self._tick % self._session.decision_ticks:
            return  # at tick 0 the training world has shown nothing yet
        for seat in self._session.seats:
            if seat.is_led and not self._batch.buffers.idle[0, seat.number]:
                self._compare_seat(seat)

    def _compare_seat(self, seat: Seat) -> None:
        number, trained = seat.number, self._trained[seat.number]
        off = float(np.abs(self._live[number] - trained).max())
        self.most_seen = max(self.most_seen, off)
        self.decisions += 1
        answer = self._driver(seat).act(Observation(self._tick, self._batch.layout, trained))
        if self._tick - self._since.setdefault(number, self._tick) < SETTLED_TICKS:
            return
        said = np.array([answer.steering, answer.throttle, answer.brake])
        off = float(np.abs(said - self._session.acting(number)[:3]).max())
        self.most_answered = max(self.most_answered, off)
        self.apart += off > ROUNDING

    def _driver(self, seat: Seat) -> Driver:
        if seat.number not in self._drivers:
            driver = driver_named(self._name)
            driver.reset(briefing_for(self._session, seat))
            self._drivers[seat.number] = driver
        return self._drivers[seat.number]


def _training_world(session: Session, preset: str) -> Batch:
    """Return a training world at the start of a session's race, that takes controls each tick."""
    scenario = session.scenario
    fitted = tuple(session.world.bodies["sensors"][0].tolist())
    task = Task((scenario,), Parking()).with_options(
        observation=preset, action="control", reward="park", decision_ticks=1
    )
    batch = Batch(task, after=STAY)
    line_up_race(batch.world, 0, replace(scenario, fitted=fitted), scenario.seed)
    return batch
