"""What becomes of a session, for the log: drivers that come and go, races that start and end.

The session is polled a few times a second and changes are logged, so no tick waits for the log.
What is refused is logged by `counters.Refusals`.
"""

import time
from dataclasses import dataclass

from race_server.core import codes
from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Phase, Status
from race_server.live.server.counters import Counters
from race_server.live.server.result import RaceResult
from race_server.live.server.timing import ServerTiming
from race_server.logs import Log
from race_server.session.failsafe import FailsafeStage
from race_server.session.session import Session


@dataclass
class _Known:
    """The state of a seat when it was last polled."""

    driver: str = ""
    is_present: bool = False
    stands: bool = False


class SessionLog:
    """Logs what happens in a session."""

    def __init__(
        self, session: Session, counters: Counters, log: Log | None, timing: ServerTiming
    ) -> None:
        """Begin without any change. log: None logs nothing."""
        self._session, self._counters, self._log = session, counters, log
        self._known = [_Known() for _ in session.seats]
        self._phase = session.phase
        self._missed = 0
        self._timing = timing
        self._next_poll = self._next_sum = 0.0

    def poll(self, now: float) -> None:
        """Log what has changed since the last poll. now: of `time.monotonic` [s]."""
        if self._log is None or now < self._next_poll:
            return
        self._next_poll = now + self._timing.log_s
        self._poll_seats(self._log)
        self._poll_phase(self._log)
        if now > self._next_sum:
            self._next_sum = now + self._timing.sum_up_s
            self._sum_up(self._log)

    def _poll_seats(self, log: Log) -> None:
        races = self._session.is_on
        statuses = self._session.world.bodies["status"][0]
        for seat, known in zip(self._session.seats, self._known, strict=True):
            driver = seat.driver if seat.is_taken else ""
            who = driver or known.driver
            if driver != known.driver:
                came = "joined" if seat.is_present else "expected back"
                log.say(came if driver else "left", seat=seat.number, driver=who)
            elif driver and seat.is_present != known.is_present:
                if seat.is_present:
                    log.say("came back", seat=seat.number, driver=who)
                elif statuses[seat.number] == codes.RACING:
                    log.warn("dropped: its link is gone", seat=seat.number, driver=who)
                else:
                    log.say("gone after its race", seat=seat.number, driver=who)
            is_racing = races and statuses[seat.number] == codes.RACING
            stands = bool(driver) and is_racing and seat.silence is FailsafeStage.STOPPED
            if stands and not known.stands and seat.is_present and seat.control_tick >= 0:
                log.warn("silent: its kart stands", seat=seat.number, driver=who)
            known.driver, known.is_present, known.stands = driver, seat.is_present, stands

    def _poll_phase(self, log: Log) -> None:
        phase = self._session.phase
        if phase is not self._phase and phase is Phase.COUNTDOWN:
            karts = len(self._session.lined_up())
            log.say("race started", epoch=self._session.epoch, karts=karts)
        self._phase = phase

    def _sum_up(self, log: Log) -> None:
        if new := self._counters.missed - self._missed:
            self._missed = self._counters.missed
            log.warn("missed ticks", new=new, all=self._missed)

    def close(self, result: RaceResult) -> None:
        """Log how a race has ended."""
        self._next_poll = 0.0
        self.poll(time.monotonic())
        if self._log is not None:
            self._log.say(
                "race ended",
                epoch=self._session.epoch,
                seconds=round(result.ticks / TICKS_PER_SECOND, 1),
                first=_first_in(result),
                missed_ticks=result.missed_ticks,
                refused=sum(result.refused.values()),
            )


def _first_in(result: RaceResult) -> str:
    """Return the driver who won, "none" where a race has ended before anyone finished."""
    rows = result.standings
    return rows[0].driver if rows and rows[0].status is Status.FINISHED else "none"
