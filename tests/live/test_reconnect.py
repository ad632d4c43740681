"""A driver whose link stalls goes on over a new one, as the same driver."""

import threading
import time
from collections import Counter

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Control, Event, EventKind, Status
from race_server.core.observation import Observation
from race_server.live.client.driver import run_driver
from race_server.live.client.link_stats import LinkStats
from race_server.live.client.timing import ClientTiming
from race_server.live.server import REAL, RaceServer
from race_server.net.transport import ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.session.session import Session
from race_server.tools.drills.stalled_link import StalledLink
from support.courses import ring


class Stepper:
    """Drives on gently; once under way its link is frozen."""

    preset = "track"

    def __init__(self, stall: StalledLink) -> None:
        self._stall, self.ticks = stall, []

    def reset(self, briefing: object) -> None:
        pass

    def act(self, seen: Observation) -> Control:
        if not self.ticks and seen.tick > 60:
            self._stall.freeze()
        if seen.tick > 60:
            self.ticks.append(seen.tick)
        return Control(0.0, 0.1)


@pytest.mark.live
def test_a_driver_whose_link_stalls_drives_on_over_a_fresh_one() -> None:
    timing = ClientTiming(observation_timeout_s=0.5)
    rules = Rules(laps=1, countdown_s=0.3, limit_s=6.0)
    course = ring(radius=4.0, half_width=0.8)
    session = Session("race", Scenario(course, karts=1, rules=rules))
    address, link_stats = free_address(), LinkStats()
    with ServerLink(address, "race", 1, real_time=True) as link:
        server = RaceServer(session, link, REAL)
        race = threading.Thread(target=server.run, args=(1,))
        race.start()
        stall = StalledLink(address)
        driver = Stepper(stall)
        began = time.monotonic()
        run_driver(
            driver,
            "stepper",
            address=stall.address,
            wanted=0,
            link_stats=link_stats,
            timing=timing,
        )
        assert time.monotonic() - began < 20.0
        race.join()
        stall.close()
        away = max(b - a for a, b in zip(driver.ticks, driver.ticks[1:], strict=False))
        assert 20 < away < 240  # half a second of silence, and what a fresh link takes
        assert driver.ticks == sorted(driver.ticks)
        assert link_stats.reconnects >= 1
        assert not Counter(link.dropped)  # no link was taken for a second login
        assert session.seats[0].driver == "stepper"
        retired = [event for event in server.events if event.kind is EventKind.RETIRED]
        assert session.world.bodies["status"][0, 0] == Status.RETIRED
        assert [event.kart for event in retired] == [0]  # when the time was over, not before
        assert retired[0].tick > 300
        assert link_stats.outcome


def test_events_that_are_told_again_count_once() -> None:
    link_stats = LinkStats()
    lap = Event(7, 300, EventKind.LAP, 2, 1, 5_000_000)
    link_stats.record_events(1, [lap], seat=2)
    link_stats.record_events(1, [lap, Event(8, 600, EventKind.LAP, 2, 2, 5_000_000)], seat=2)
    assert link_stats.laps == 2
    link_stats.record_events(2, [lap], seat=2)  # another race counts from the start
    assert link_stats.laps == 3
