"""Debian's Chromium, which nothing here downloads, and the page that it shows."""

import importlib.util
import shutil

from race_server.live.gateway.page import NOT_BUILT, is_built

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
MISSING = "no Chromium here: apt-get install chromium"
PAGE_ERROR = "page error"  # event of a log
# WebGL by the processor, where there is no graphics card.
WEBGL_IN_SOFTWARE = ("--enable-unsafe-swiftshader", "--use-angle=swiftshader")


def missing_page() -> str:
    """Return in a sentence why no page can be driven here, "" if one can."""
    if importlib.util.find_spec("playwright") is None:
        return 'playwright is not installed: pip install "race-server[page-test]"'
    if not CHROMIUM:
        return MISSING
    return "" if is_built() else NOT_BUILT
