"""The page in a real browser: Debian's Chromium, which nothing here downloads."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from race_server.competition.launch import free_address
from race_server.core.hint import Hint, HintKind
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.hint import encode_hint
from support.chromium import NEEDS_CHROMIUM, TURN_S, KeyDriver, Page, Stage, chromium
from support.courses import ring
from support.served_race import gated, racing, record_race, wait_for_race
from support.servers import wait_until

pytestmark = NEEDS_CHROMIUM

KARTS = 8
OWN = 7  # the seat that is driven from the page


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    """Seven scripted karts and a lobby that waits for one driver; a recording of another race."""
    address, folder = free_address(), tmp_path_factory.mktemp("recordings")
    with (
        pytest.MonkeyPatch.context() as patch,
        chromium() as browser,
    ):
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
        course = ring(radius=4.0, half_width=0.7)
        record_race(folder, course)
        with (
            racing(address, karts=KARTS, drivers=1, course=course) as server,
            gated(address, recordings=folder) as served,
        ):
            served.server = server
            wait_for_race(served)
            yield Stage(served, browser)


@pytest.fixture(scope="module")
def watching(stage: Stage) -> Page:
    """The page of a spectator, from the lobby on."""
    return stage.open("watch", 1920, 1080)


@pytest.fixture(scope="module")
def driving(stage: Stage, watching: Page) -> Page:
    """The page of the driver, and with it the race: it begins when the driver is ready."""
    page = stage.open("drive&token=drive one")
    page.fill("input[name=name]", "Ada")
    page.fill("input[name=seat]", str(OWN))
    page.get_by_role("button", name="Take the seat").click()
    page.get_by_test_id("ready").click()
    watching.get_by_test_id("phase").get_by_text("Race").wait_for()
    return page


def stats(page: Page) -> dict[str, Any]:
    """Return what the page says of itself."""
    said: dict[str, Any] = page.evaluate(
        "(({way, race, scene, headset, ...figures}) => figures)(window.__race)"
    )
    return said


def karts(page: Page) -> dict[int, dict[str, float]]:
    """Return the karts as the page knows them, by seat."""
    return {int(kart["seat"]): kart for kart in stats(page)["karts"]}


def drive_by_keys(page: Page, is_done: Callable[[], object], timeout_s: float) -> None:
    """Press and release keys so that the own kart goes around the course, rather slowly."""
    driver, deadline = KeyDriver(page), time.monotonic() + timeout_s
    while not is_done():
        assert time.monotonic() < deadline, driver.state
        driver.turn()
        time.sleep(TURN_S)
    driver.press(set())


def test_a_lap_is_driven_by_pressing_keys(driving: Page, watching: Page) -> None:
    row = watching.locator(f"[data-testid=leaderboard] tr[data-seat='{OWN}']")
    drive_by_keys(driving, lambda: karts(driving)[OWN]["laps"] >= 1, timeout_s=150.0)
    # The lap that was driven stands in the table of those who watch.
    wait_until(lambda: ":" in row.inner_text() or "." in row.locator("td").nth(6).inner_text())
    assert "Ada" in row.inner_text()
    assert stats(driving)["delay_ms"]["p50"] < 200.0


def test_nobody_drives_while_the_page_is_not_in_front(driving: Page) -> None:
    note = driving.get_by_text("Your kart has no driver")
    driving.evaluate("dispatchEvent(new Event('blur'))")
    note.wait_for()
    driving.get_by_test_id("notice").get_by_text("The server brakes your kart").wait_for()
    driving.keyboard.press("ArrowUp")
    note.wait_for(state="hidden")


def test_a_page_that_is_loaded_again_has_its_seat_back(driving: Page) -> None:
    assert "token" not in driving.url  # no one reads it over the driver's shoulder
    driving.reload()
    driving.get_by_test_id("speed").wait_for()
    drive_by_keys(driving, lambda: karts(driving)[OWN]["speed"] > 1.0, timeout_s=90.0)


def test_a_driver_reads_what_its_coach_says_and_nobody_else_does(
    stage: Stage, driving: Page, watching: Page
) -> None:
    cue = Hint(kind=HintKind.EARLY_BRAKES, corner="T2", size=4.0, reach=9.0)
    lap = Hint(2, 31_250_000, 1_500_000, "", HintKind.SLOW_BEND, "T2", 1.5, 9.0, ((0.0, 5.0),))
    words = driving.get_by_test_id("coach")
    with ClientLink(stage.served.address, "race") as coach:

        def is_shown(hint: Hint, said: str) -> bool:  # a cue is gone after two seconds
            coach.tell(topics.COACH, encode_hint(1, hint), OWN)
            time.sleep(0.2)
            return words.get_by_text(said).count() == 1

        wait_until(lambda: is_shown(lap, "T2: carry 5.4 km/h more through the bend"))
        wait_until(lambda: is_shown(cue, "brake later"))
    assert words.get_by_text("Lap 2: 31.250, +1.50 s to the limit").count() == 1
    assert watching.get_by_test_id("coach").count() == 0


def test_eight_karts_move(watching: Page, driving: Page) -> None:
    before = karts(watching)
    assert len(before) == KARTS
    others = set(before) - {OWN}

    def moved() -> set[int]:
        now = karts(watching)
        return {
            seat
            for seat in others
            if math.dist((now[seat]["x"], now[seat]["y"]), (before[seat]["x"], before[seat]["y"]))
            > 0.2
        }

    wait_until(lambda: moved() == others)


def test_the_leaderboard_is_in_the_order_of_the_server(
    stage: Stage, watching: Page, driving: Page
) -> None:
    assert stage.served.server is not None
    session = stage.served.server.session
    rows = watching.locator("[data-testid=leaderboard] tbody tr")

    def shown() -> list[int]:
        return rows.evaluate_all("rows => rows.map(row => Number(row.dataset.seat))")

    def published() -> list[int]:
        return [row.seat for row in sorted(session.standings(), key=lambda row: row.rank)]

    wait_until(lambda: len(shown()) == KARTS and shown() == published())


def test_a_big_screen_shows_twenty_mini_sectors_of_each_kart(stage: Stage, driving: Page) -> None:
    page = stage.open("timing")
    rows = page.get_by_test_id("leaderboard").locator("tbody tr")
    wait_until(lambda: rows.count() == KARTS)
    wait_until(lambda: rows.first.locator("td.minis i").count() == 20)
    wait_until(lambda: 0 < rows.first.locator("td.minis i.merit-0").count() < 20)
    page.context.close()


def test_race_control_tells_of_laps_and_items(watching: Page, driving: Page) -> None:
    events = watching.get_by_test_id("race-control")
    wait_until(lambda: "picks up" in events.inner_text() and "lap 1 in" in events.inner_text())


def test_a_steward_shows_a_yellow_flag_and_everybody_sees_it(
    stage: Stage, watching: Page, driving: Page
) -> None:
    steward = stage.open("steward&token=steward one")
    steward.get_by_role("button", name="Yellow flag").click()
    assert not watching.get_by_test_id("flag-banner").is_visible()  # asked, not yet done
    steward.get_by_role("button", name="Yes, do it").click()
    watching.get_by_test_id("flag-banner").get_by_text("Yellow flag").wait_for()
    driving.get_by_text("Yellow flag").first.wait_for()
    steward.get_by_test_id("answer").get_by_text("done").wait_for()
    steward.get_by_test_id("log").get_by_text("yellow flag").wait_for()
    steward.get_by_role("button", name="Green flag").click()
    steward.get_by_role("button", name="Yes, do it").click()
    watching.get_by_test_id("flag-banner").wait_for(state="hidden")
    steward.context.close()


def test_a_recording_is_opened_and_scrubbed(stage: Stage) -> None:
    page = stage.open("replay=")
    page.get_by_test_id("recordings").get_by_role("button").first.click()
    page.get_by_test_id("play").get_by_text("Pause").wait_for()  # it plays at once
    wait_until(lambda: stats(page)["tick"] > 30)
    page.get_by_test_id("play").click()
    slider = page.get_by_test_id("scrubber")
    slider.focus()
    page.keyboard.press("End")
    last = int(slider.get_attribute("max") or 0)
    wait_until(lambda: stats(page)["tick"] >= last - 2)
    assert "is over" in page.get_by_test_id("race-control").inner_text()
    page.keyboard.press("Home")
    wait_until(lambda: stats(page)["tick"] <= 1)
    page.get_by_role("button", name="One tick on").click()
    wait_until(lambda: page.get_by_test_id("tick").inner_text() == "1")
    page.context.close()


def test_a_wrong_token_is_refused_in_plain_words(stage: Stage) -> None:
    page = stage.open("steward&token=wrong", 390, 844)
    said = page.locator("[data-testid=overlay] [data-code=token]")
    said.get_by_text("The token is not valid").wait_for()
    page.context.close()


@pytest.mark.parametrize("role", ["steward", "drive"])
def test_after_a_wrong_token_another_one_can_be_typed(
    stage: Stage, driving: Page, role: str
) -> None:
    page = stage.open(f"{role}&token=wrong")
    if role == "drive":
        page.fill("input[name=name]", "Eve")
        page.get_by_role("button", name="Take the seat").click()
    page.locator("[data-testid=overlay] [data-code=token]").wait_for()
    page.get_by_role("button", name="Try again").click()
    page.fill("input[type=password]", f"{role} one")
    page.keyboard.press("Enter")
    if role == "steward":
        page.get_by_role("button", name="Yellow flag").wait_for()
    else:  # it fits, but another page drives with it
        page.locator("[data-testid=overlay] [data-code=used]").wait_for()
    page.context.close()


@pytest.mark.slow
def test_a_key_that_is_held_on_the_line_of_time_does_not_end_the_visit(stage: Stage) -> None:
    page = stage.open("replay=")
    sockets: list[object] = []
    # Playwright marks the handler, which a builtin method does not allow.
    page.on("websocket", lambda opened: sockets.append(opened))
    page.get_by_test_id("recordings").get_by_role("button").first.click()
    play = page.get_by_test_id("play")
    play.get_by_text("Pause").click()  # it plays at once: stand still
    play.get_by_text("Play").wait_for()
    page.get_by_test_id("scrubber").focus()
    for _ in range(150):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Home")
    wait_until(lambda: stats(page)["tick"] <= 1)
    page.wait_for_timeout(1000)  # a page that was disconnected would be back by now
    assert len(sockets) == 1
    page.context.close()


@pytest.mark.parametrize("place", ["watch", "drive", "steward"])
def test_no_page_is_wider_than_a_narrow_phone_in_the_longer_language(
    stage: Stage, place: str
) -> None:
    size = {"width": 360, "height": 640}
    page = stage.browser.new_context(viewport=size, locale="fr").new_page()
    page.goto(f"{stage.served.base}#{place}")
    page.get_by_role("navigation").get_by_text("Rediffusions").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    page.context.close()


def test_on_a_phone_arrow_keys_go_through_the_tabs(stage: Stage) -> None:
    page = stage.open("watch", 390, 844)
    page.get_by_role("tab", name="Standings").focus()
    page.keyboard.press("ArrowRight")
    chosen = page.get_by_role("tab", selected=True)
    assert chosen.inner_text() == "Race control"
    assert chosen.evaluate("tab => tab === document.activeElement")
    assert page.get_by_role("tabpanel", name="Race control").is_visible()
    page.context.close()


def test_nothing_went_wrong_on_any_page_and_nothing_was_asked_of_others(stage: Stage) -> None:
    assert stage.troubles == []
