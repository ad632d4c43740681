"""Debian's Chromium, which nothing here downloads."""

import shutil

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
MISSING = "no Chromium here: apt-get install chromium"
# WebGL by the processor, where there is no graphics card.
WEBGL_IN_SOFTWARE = ("--enable-unsafe-swiftshader", "--use-angle=swiftshader")
