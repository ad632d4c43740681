"""An event on the page in a real browser: who leads, a protest, and what stewards decide on it."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.competition.event_spec import begin_event
from race_server.competition.launch import free_address
from race_server.competition.live_event import LiveEvent
from race_server.core.driver import driver_named
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.live.server.timing import ServerTiming
from race_server.live.server.warm_up import warm_up
from race_server.logs import Log
from race_server.net.auth.token import local_token
from race_server.net.transport import ServerLink
from race_server.session.session import Session
from support.chromium import NEEDS_CHROMIUM, Page, Stage, chromium
from support.served_event import TRIAL, Served, spec_of
from support.served_race import gated, wait_for_race
from support.servers import wait_until

pytestmark = NEEDS_CHROMIUM

DRIVERS = ("raceline", "follow_gap")
ADA = 2  # the seat that a page has


def hold(server: RaceServer, folder: Path) -> None:
    """Hold a time trial of one attempt, once a page has its seat; it is under review to the end.

    The page has nothing to drive with: soon after its start it counts as gone.
    """
    stage = replace(TRIAL.stages[0], attempts=1)
    spec = replace(spec_of(folder, replace(TRIAL, stages=(stage,))), review_s=600.0)
    for seat, name in enumerate(DRIVERS):
        server.local_drivers.admit(name, driver_named(name), seat)
    server.lobby.wait_until(lambda: server.session.seats[ADA].is_taken)
    state = begin_event(server, spec, len(DRIVERS) + 1)
    if state is not None:
        LiveEvent(server, spec, state, Log(), lambda *_: None).run()


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "runtime"))
    address, seats = free_address(), len(DRIVERS) + 1
    scenario = Served.scenario_for(seats)
    warm_up(scenario, DRIVERS)  # compiled while a page waits, it would take longer than that waits
    with (
        chromium() as browser,
        local_token(address, "race") as token,
        ServerLink(address, "race", seats) as link,
        gated(address) as served,
    ):
        timing = ServerTiming(answer_s=1.0)
        session = Session("race", scenario)
        server = RaceServer(session, link, LOCKSTEP, token=token, timing=timing)
        thread = threading.Thread(target=hold, args=(server, tmp_path))
        thread.start()
        try:
            wait_for_race(served)
            yield Stage(served, browser)
        finally:
            server.stop()
            thread.join(20.0)


def leads(page: Page, team: str) -> bool:
    return team in page.locator("[data-testid=classification] td.name").first.inner_text()


def test_a_driver_protests_stewards_uphold_and_all_see_who_leads_now(stage: Stage) -> None:
    driving = stage.open("drive&token=drive one")
    driving.fill("input[name=name]", "Ada")
    driving.fill("input[name=seat]", str(ADA))
    driving.get_by_role("button", name="Take the seat").click()
    driving.get_by_test_id("ready").click()
    watching = stage.open("watch", 1920, 1080)
    watching.get_by_test_id("event").get_by_text("3 of 3 driven").wait_for()
    wait_until(lambda: leads(watching, "raceline"))

    driving.get_by_test_id("protest").click()
    driving.get_by_label("Against").select_option(label="raceline")
    driving.get_by_label("Reason").fill("was pushed")
    driving.get_by_role("button", name="Lodge").click()
    driving.get_by_text("Protest lodged").wait_for()

    steward = stage.open("steward&token=steward one", 1280, 900)
    protests = steward.get_by_test_id("protests")
    protests.get_by_text("Ada against raceline").wait_for()
    protests.get_by_role("button", name="Uphold, +5 s").click()
    protests.get_by_role("button", name="Yes, do it").click()
    protests.get_by_text("upheld, +5 s").wait_for()
    wait_until(lambda: leads(watching, "follow_gap"))
    watching.get_by_text("+5 s protest 1").first.wait_for()
    assert stage.troubles == []
