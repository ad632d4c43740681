"""Pages in a real browser: Debian's Chromium, which nothing here downloads."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest

pytest.importorskip("playwright", reason="playwright is not installed: pip install -e '.[test]'")

from playwright.sync_api import Browser, ConsoleMessage, Request, sync_playwright
from playwright.sync_api import Page as Page

from race_server.tools.drills.chromium import CHROMIUM, missing_page
from race_server.tools.drills.page_drivers import TURN_S as TURN_S
from race_server.tools.drills.page_drivers import KeyDriver as KeyDriver
from support.served_race import ServedRace

NEEDS_CHROMIUM = [
    pytest.mark.live,
    pytest.mark.skipif(bool(missing_page()), reason=missing_page()),
]


@contextmanager
def chromium(arguments: Sequence[str] = (), without: Sequence[str] = ()) -> Iterator[Browser]:
    """Run a browser until the end of the block. without: arguments that it has by default."""
    with (
        sync_playwright() as play,
        play.chromium.launch(
            executable_path=CHROMIUM,
            args=["--no-sandbox", *arguments],
            ignore_default_args=list(without),
        ) as browser,
    ):
        yield browser


@dataclass
class Stage:
    """A race, its gateway, and the pages that look at it."""

    served: ServedRace
    browser: Browser
    scripts: tuple[str, ...] = ()  # run before the page's own
    troubles: list[str] = field(default_factory=list)  # errors, and requests to other hosts

    def open(self, place: str, width: int = 1024, height: int = 768) -> Page:
        """Open a page in a separate browser context, as another person would."""
        size = {"width": width, "height": height}
        page = self.browser.new_context(viewport=size, locale="en").new_page()
        for script in self.scripts:
            page.add_init_script(script)
        page.on("console", self._record_message)
        page.on("pageerror", lambda error: self.troubles.append(str(error)))
        page.on("request", self._check_request)
        page.goto(f"{self.served.base}#{place}&stats=1")
        return page

    def _record_message(self, message: ConsoleMessage) -> None:
        # Software drawing says on each read that it is slow.
        if message.type in {"error", "warning"} and "GPU stall" not in message.text:
            self.troubles.append(message.text)

    def _check_request(self, request: Request) -> None:
        own = (self.served.base, self.served.base.replace("http", "ws", 1), "data:", "blob:")
        if not request.url.startswith(own):
            self.troubles.append(f"asks for {request.url}")
