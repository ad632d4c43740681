"""Takes the pictures of the page that README and docs show: `make pictures`.

A race is recorded in lock-step, and a browser plays the recording, moment by moment, so that a
slow machine gets the same pictures as a fast one.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, ViewportSize, sync_playwright

from race_docs.pages import ROOT
from race_server.competition.launch import free_address
from race_server.terminal import Console
from race_server.tools.drills.chromium import CHROMIUM, MISSING, WEBGL_IN_SOFTWARE

RACE = Path(sys.executable).with_name("race")
ARGUMENTS = ["--no-sandbox", *WEBGL_IN_SOFTWARE]

KARTS = 8
WINDOW: ViewportSize = {"width": 1280, "height": 720}
# The animation: a moment each 6 ticks from when the lights go out, shown for 0.1 s.
FIRST_TICK, STEP_TICKS, MOMENTS = 186, 6, 54
WIDTH = 520  # [px]
COLOURS = 96
PATIENCE_S = 120.0


def main() -> None:
    """Take all pictures, into docs/."""
    console = Console()
    with tempfile.TemporaryDirectory() as name, console.status("a race is recorded") as status:
        folder = Path(name)
        _record(folder)
        with _gateway(folder) as base, _page(base, folder) as page:
            _follow(page, seat=KARTS - 1, eye="chase")
            _seek(page, FIRST_TICK + 130)
            page.screenshot(path=ROOT / "docs/page-space.png")
            moments = []
            for number in range(MOMENTS):
                status.update(f"moment {number + 1} of {MOMENTS}")
                _seek(page, FIRST_TICK + number * STEP_TICKS)
                moments.append(_scene(page))
    _animate(moments, ROOT / "docs/page-space.gif")


def _record(folder: Path) -> None:
    words = ["serve", "--listen", free_address(), "--track", "colline-1100", "--vehicle", "kart-60"]
    words += ["--karts", str(KARTS), "--fill", "raceline,pure_pursuit", "--laps", "1"]
    words += ["--pace", "lockstep", "--one-process", "--once", "--wait-for", "0", "--seed", "4"]
    words += ["--record", str(folder), "--results", str(folder / "results.sqlite")]
    subprocess.run([RACE, *words], check=True, stdout=subprocess.DEVNULL)


@contextmanager
def _gateway(folder: Path) -> Iterator[str]:
    """Serve the page and the recordings of a folder, and give the page's address."""
    words = ["gateway", "--port", "0", "--json", "--recordings", str(folder)]
    words += ["--connect", free_address()]
    with subprocess.Popen([RACE, *words], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        try:
            yield str(json.loads(process.stdout.readline())["base"])
        finally:
            process.terminate()


@contextmanager
def _page(base: str, folder: Path) -> Iterator[Page]:
    """Open the only recording of a folder, in three dimensions, standing at its beginning."""
    if not CHROMIUM:
        raise SystemExit(MISSING)
    (recording,) = folder.glob("*.mcap")
    with (
        sync_playwright() as play,
        play.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS) as chromium,
    ):
        page = chromium.new_context(viewport=WINDOW, locale="en", color_scheme="dark").new_page()
        page.set_default_timeout(1e3 * PATIENCE_S)
        page.goto(f"{base}#replay={recording.stem}&stats=1")
        page.get_by_test_id("play").get_by_text("Pause").click()
        page.get_by_test_id("play").get_by_text("Play").wait_for()
        page.get_by_test_id("space").dispatch_event("click")
        _wait(page, "!!window.__race?.scene")
        page.evaluate("window.__race.scene.hold(2)")  # sharp, however slow it is
        yield page


def _follow(page: Page, *, seat: int, eye: str) -> None:
    page.get_by_test_id("follow").select_option(str(seat))
    page.get_by_test_id("eye").select_option(eye)


def _seek(page: Page, tick: int) -> None:
    """Go to a tick of the recording, and wait until it is drawn."""
    page.get_by_test_id("scrubber").evaluate(
        """(line, tick) => {
          line.value = tick;
          line.dispatchEvent(new Event('input', { bubbles: true }));
          line.dispatchEvent(new Event('change', { bubbles: true }));
        }""",
        tick,
    )
    _wait(page, f"Math.abs(window.__race.tick - {tick}) < 2")
    frames = page.evaluate("window.__race.frames")
    _wait(page, f"window.__race.frames > {frames + 1}")


def _wait(page: Page, condition: str) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not page.evaluate(condition):
        if time.monotonic() > deadline:
            raise SystemExit(f"not drawn within {PATIENCE_S:g} s: {condition}")
        time.sleep(0.05)


def _scene(page: Page) -> Image.Image:
    """Return the picture in three dimensions alone."""
    picture = Image.open(BytesIO(page.get_by_test_id("scene").screenshot())).convert("RGB")
    height = round(WIDTH * picture.height / picture.width)
    return picture.resize((WIDTH, height), Image.Resampling.LANCZOS)


def _animate(moments: list[Image.Image], path: Path) -> None:
    """Write pictures as an animation that begins again."""
    some = moments[::9]
    height = moments[0].height
    all_colours = Image.new("RGB", (WIDTH, height * len(some)))
    for number, one in enumerate(some):
        all_colours.paste(one, (0, number * height))
    palette = all_colours.quantize(COLOURS)
    shown = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in moments]
    shown[0].save(path, save_all=True, append_images=shown[1:], duration=100, loop=0)


if __name__ == "__main__":
    main()
