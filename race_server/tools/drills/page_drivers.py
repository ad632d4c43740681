"""People at the page of an event: each has a browser and drives by keys; another page watches.

The process runs until it is ended. It takes pictures: of the page that watches, one for each stage
and phase of the event, and of each driver's, one for each stage.
"""

import math
import signal
import sys
import time
import urllib.request
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, TimeoutError, sync_playwright

from race_server.competition.launch import START_S
from race_server.core.messages import EventPhase, Phase
from race_server.logs import Log
from race_server.tools.drills.chromium import CHROMIUM, PAGE_ERROR
from race_server.tools.drills.server_process import wait_until

# A driver looks this far along its way [m], and drives at this speed [m/s]: keys are coarse, and a
# browser on a busy machine is late.
AHEAD_M, SPEED = 1.0, 1.7
WHEELBASE_M = 0.257  # of the 1/10 car
# A wheel that is nearer to where it should be stays as it is [rad].
TOLERANCE = 0.04
TURN_S, CLICK_MS = 0.02, 500.0
WATCH_S = 0.5
# A picture of what is on the track is taken this long after its start [ticks].
ON_TRACK_TICKS = 360
SMALL, LARGE = (480, 320), (1280, 720)
FLAT = "localStorage.setItem('race.space', 'no')"

# In an event a driver gets ready when it is called.
_STATE = """() => {
  const { race, seat, phase } = window.__race ?? {};
  const button = document.querySelector('[data-testid=ready]');
  const own = race?.programme?.teams.find((team) => team.seat === seat);
  const isCalled = !own || race.programme.now?.teams.includes(own.name);
  return { phase, kart: race?.kart(seat) ?? null,
           canBeReady: isCalled && button?.getAttribute('aria-pressed') === 'false' };
}"""
# The centre line, which is far from the borders; the reference line where obstacles stand on that.
_WAY = """() => {
  const { race, way, line } = window.__race;
  return race.course?.frame.obstacles.length ? line() : way();
}"""
_EVENT = """() => {
  const { race, tick } = window.__race ?? {};
  const event = race?.programme, start = race?.standings?.startTick ?? 0;
  return event ? { stage: event.stage, phase: event.phase, driven: tick - start } : null;
}"""

Facts = dict[str, Any]


class KeyDriver:
    """Drives the kart of a page by pressing and releasing keys, rather slowly."""

    def __init__(self, page: Page) -> None:
        """Drive with a page that has a seat."""
        self.page = page
        self.state: Facts = {}
        self._down: set[str] = set()
        self._way: list[list[float]] = []

    def turn(self) -> None:
        """Look at the page, and press what is needed; in a lobby get ready."""
        before, self.state = self.state, self.page.evaluate(_STATE)
        kart, phase = self.state["kart"], self.state["phase"]
        if phase == Phase.RUNNING and kart is not None:
            if before.get("phase") != phase or not self._way:
                self._way = self.page.evaluate(_WAY)
            self.press(keys_for(kart, self._way) if self._way else set())
            return
        self.press(set())
        if phase == Phase.LOBBY and self.state["canBeReady"]:
            with suppress(TimeoutError):  # the lobby is over
                self.page.get_by_test_id("ready").click(timeout=CLICK_MS)

    def press(self, wanted: set[str]) -> None:
        """Have these keys down, and no others."""
        for key in self._down - wanted:
            self.page.keyboard.up(key)
        for key in wanted - self._down:
            self.page.keyboard.down(key)
        self._down = wanted


def keys_for(kart: Facts, way: list[list[float]]) -> set[str]:
    """Return the keys that take a kart along a way, by pure pursuit. way: x, y [m] of points."""
    near = min(range(len(way)), key=lambda i: math.dist(way[i], (kart["x"], kart["y"])))
    x, y = way[(near + round(AHEAD_M / math.dist(way[0], way[1]))) % len(way)]
    turn = math.atan2(y - kart["y"], x - kart["x"]) - kart["heading"]
    # The angle of the wheels for which pure pursuit asks, against where they are.
    lack = math.atan(2.0 * WHEELBASE_M * math.sin(turn) / AHEAD_M) - kart["steering"]
    keys = {"ArrowUp"} if kart["speed"] < SPEED else set()
    if abs(lack) > TOLERANCE:
        keys.add("ArrowLeft" if lack > 0.0 else "ArrowRight")
    return keys


class EventWatcher:
    """The page of an event, as spectators have it, and its pictures."""

    def __init__(self, page: Page, folder: Path) -> None:
        """Take pictures into a folder."""
        self._page, self._folder = page, folder
        self._taken: set[str] = set()
        self.stage = ""
        self.is_driven = False

    def turn(self) -> None:
        """Look at the page; take a picture of what is new."""
        seen: Facts | None = self._page.evaluate(_EVENT)
        if seen is None:
            return
        phase = EventPhase(seen["phase"])
        self.stage = seen["stage"]
        self.is_driven = phase is EventPhase.ON_TRACK and seen["driven"] > ON_TRACK_TICKS
        if phase is not EventPhase.ON_TRACK or self.is_driven:
            self.take(f"{self.stage} {phase.name}", self._page)

    def take(self, name: str, page: Page) -> None:
        """Take a picture of a page, the first time that it is asked for under this name."""
        if name not in self._taken:
            self._taken.add(name)
            name = name.lower().replace(" ", "-").replace("_", "-")
            page.screenshot(path=self._folder / f"{name}.png")


def open_page(browser: Browser, address: str, size: tuple[int, int], log: Log) -> Page:
    """Open an address in a separate browser context, as another person would.

    Errors of the page stand in the log.
    """
    width, height = size
    context = browser.new_context(viewport={"width": width, "height": height}, locale="en")
    page = context.new_page()
    page.add_init_script(FLAT)
    page.on("pageerror", lambda error: log.warn(PAGE_ERROR, why=str(error)))
    page.goto(f"{address}&stats=1")
    return page


def take_seat(page: Page, name: str) -> None:
    """Fill in the form of the page that asks for name and seat."""
    page.fill("input[name=name]", name)
    page.get_by_role("button", name="Take the seat").click()
    # Not by `wait_for_function`, which evaluates text in the page, as its security policy forbids.
    wait_until(lambda: page.evaluate("window.__race?.seat >= 0"), START_S, f"a seat for {name}")


def _is_there(base: str) -> bool:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(f"{base}healthz", timeout=5.0) as answer:
        return b"a race is there" in answer.read()


def drive_event(base: str, folder: Path, people: Sequence[tuple[str, str]]) -> None:
    """Drive an event from browsers. people: name and address of each."""
    log = Log(as_json=True)
    wait_until(lambda: _is_there(base), START_S, "a race at the gateway")
    with (
        sync_playwright() as play,
        play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"]) as browser,
    ):
        drivers = []
        for name, address in people:
            page = open_page(browser, address, SMALL, log)
            take_seat(page, name)
            drivers.append((name, KeyDriver(page)))
        watcher = EventWatcher(open_page(browser, f"{base}#watch", LARGE, log), folder)
        watch_at = 0.0
        while True:
            for name, driver in drivers:
                driver.turn()
                if watcher.is_driven and driver.state["kart"] is not None:
                    watcher.take(f"{watcher.stage} {name}", driver.page)
            if time.monotonic() > watch_at:
                watch_at = time.monotonic() + WATCH_S
                watcher.turn()
            time.sleep(TURN_S)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    where, place, *words = sys.argv[1:]
    drive_event(where, Path(place), list(zip(words[::2], words[1::2], strict=True)))
