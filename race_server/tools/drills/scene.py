"""A session under attack: a race of honest drivers, an honest spectator, and what was found."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field

from race_server.live.client.seat import ClientSeat, take_seat
from race_server.logs import Log
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import Join
from race_server.tools.drills.intruder import Ears
from race_server.tools.drills.report import Finding
from race_server.tools.drills.served_session import ServedSession, served_session

SEATS, SPECTATORS = 3, 4


@dataclass
class Scene:
    """The session under attack, its honest participants, and the findings."""

    served: ServedSession
    drivers: list[ClientSeat]
    spectator: ClientLink
    arrived: Ears  # what reached the server
    told: Ears  # what reached an honest spectator and an honest driver
    findings: list[Finding] = field(default_factory=list)

    def deny(self, act: str, seen: str) -> None:
        """Record a forbidden act; seen: "" if it had no effect, otherwise the effect."""
        self.findings.append(Finding(act, "denied", seen or "denied", not seen))

    def allow(self, act: str, seen: str = "") -> None:
        """Record a legal act; seen: "" if it had its effect, otherwise what was missing."""
        self.findings.append(Finding(act, "allowed", seen or "allowed", not seen))

    def reached(self, payload: bytes) -> str:
        """Return which parties an intruder's payload reached, "" for none."""
        who = [("the server", self.arrived), ("others", self.told)]
        return " and ".join(f"reached {name}" for name, ears in who if payload in ears.heard)


@contextlib.contextmanager
def scene_of(log: Log) -> Iterator[Scene]:
    """Start a race of honest drivers with an honest spectator."""
    with served_session(SEATS, SPECTATORS, log=log) as served, contextlib.ExitStack() as stack:
        arrived, told = Ears(), Ears()
        served.server.link.receive_everything(arrived.hear_at)
        links = [stack.enter_context(served.link(f"seat-{seat}")) for seat in range(SEATS)]
        drivers = [
            take_seat(link, Join(f"honest {seat}", "track", seat))
            for seat, link in enumerate(links)
        ]
        spectator = stack.enter_context(served.link("spectator"))
        for topic in (topics.SNAPSHOT, topics.EVENTS, topics.STANDINGS):
            spectator.listen(topic, told.hear)
        links[1].listen(topics.OBSERVATION, told.hear, 1)
        for driver in drivers:
            driver.act(topics.READY)
        yield Scene(served, drivers, spectator, arrived, told)
