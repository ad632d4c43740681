"""The documentation site: built without a warning, searched, and read on a narrow screen."""

import http.server
import os
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("sphinx", reason="sphinx is not installed: pip install -e '.[docs]'")

from race_docs.pages import ROOT
from race_server.tools.drills.chromium import CHROMIUM, MISSING

FOLDERS = (
    "race_server",
    "agents",
    "docs",
    "schemas",
    "tracks",
    "lots",
    "tests",
    "examples",
    "web",
    ".ci",
)
LEFT_OUT = ("__pycache__", "node_modules", "_build", "generated_docs", "cells", "build")
# What people look for, and the page that answers: among the first three.
TERMS = {
    "lidar noise": ("time-trial", "training"),
    "penalty": ("rules",),
    "wrong way": ("race-day", "rules"),
    "yellow flag": ("real-karts", "rules"),
    "boost": ("rules",),
    "reconnect": ("operations", "where"),
    "prometheus": ("operations",),
    "certificate": ("security",),
    "foxglove": ("recordings",),
    "replay": ("recordings", "commands"),
    "curriculum": ("training", "settings"),
    "warm_start": ("settings",),
    "radar": ("observations",),
    "reward": ("observations",),
    "Pose": ("messages", "real-karts"),
    "KartClient": ("api",),
    "SeatError": ("errors",),
    "nginx": ("gateway",),
    "tyre": ("011-brush-tyres", "where"),
    "recipes": ("contributing",),
}

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


def copy_to(folder: Path) -> Path:
    """Copy what the site is made of, and return the copy's root."""
    for name in FOLDERS:
        ignored = shutil.ignore_patterns(*LEFT_OUT, *(["generated"] if name == "docs" else []))
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for path in ROOT.glob("*"):
        if path.is_file():
            shutil.copy(path, folder)
    (folder / ".src").mkdir()
    (folder / ".src" / "race_agents").symlink_to(folder / "agents")
    return folder


def build(root: Path, builder: str = "html") -> subprocess.CompletedProcess[str]:
    """Build the site of a copy as `make docs` does."""
    (command,) = re.findall(
        r"^docs:.*\n\t\$\(BIN\)/python -m (sphinx .*)$", (root / "Makefile").read_text(), re.M
    )
    words = command.replace("-b html", f"-b {builder}").split()
    return subprocess.run(
        [sys.executable, "-m", *words],
        cwd=root,
        env=os.environ | {"PYTHONPATH": f"{root}{os.pathsep}{root / '.src'}"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built from a copy of the repository."""
    root = copy_to(tmp_path_factory.mktemp("site"))
    done = build(root)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return root / "docs" / "_build"


def rename(root: Path, folder: str, pattern: str, old: str, new: str) -> None:
    """Rename a word in all files of a folder that match a pattern."""
    for path in (root / folder).rglob(pattern):
        text = path.read_text(encoding="utf-8")
        changed = re.sub(rf"(?<![\w-]){old}(?![\w-])", new, text)
        if changed != text:
            path.write_text(changed, encoding="utf-8")


def rename_function(root: Path) -> None:
    for folder in ("race_server", "agents"):
        rename(root, folder, "*.py", "time_trial_task", "solo_task")


def rename_option(root: Path) -> None:
    rename(root, "race_server/cli", "*.py", "--vehicle", "--car")


def rename_field(root: Path) -> None:
    rename(root, "schemas", "*.fbs", "stamp", "taken_at")


@pytest.mark.parametrize(
    ("mutate", "complaint"),
    [
        (rename_function, r"README\.md:\d+: WARNING: there is no race_server\.\S*time_trial_task"),
        (rename_option, r"docs/\S+\.md:\d+: WARNING: `race \w+` has no option --vehicle"),
        (rename_field, r"docs/real-karts\.md:\d+: WARNING: the schema's Pose has no field 'stamp'"),
    ],
    ids=["function", "option", "field"],
)
def test_what_is_renamed_in_the_code_and_not_in_the_pages_breaks_the_build(
    mutate: Callable[[Path], None], complaint: str, tmp_path: Path
) -> None:
    root = copy_to(tmp_path)
    mutate(root)
    done = build(root, "dummy")
    assert done.returncode != 0
    assert re.search(complaint, done.stderr), done.stderr


def test_generated_pages_hold_every_command_message_and_error(site: Path) -> None:
    text = {path.stem: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    assert "race track check" in text["commands"]
    assert "--finish-limit" in text["commands"]
    assert "lateral_speed" in text["messages"]
    assert "SeatError" in text["errors"]
    assert "KartClient" in text["api"]
    assert "steering_weight" in text["settings"]
    assert "course_curvature" in text["observations"] or "lidar_before" in text["observations"]


def test_runs_of_reproductions_are_not_on_the_site(site: Path) -> None:
    assert not [path for path in site.rglob("*") if path.parent.name == "cells"]
    assert len(list(site.glob("results/*/README.html"))) >= 7


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves the site without a word on stderr."""

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture(scope="module")
def browser(site: Path) -> Iterator[tuple[Any, str, list[str]]]:
    """A narrow page in Chromium, the site's address, and everything that goes wrong in it."""
    if not CHROMIUM:
        pytest.skip(MISSING)
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    base = f"http://127.0.0.1:{server.server_port}"
    troubles: list[str] = []
    with (
        playwright.sync_playwright() as play,
        play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"]) as chromium,
    ):
        page = chromium.new_page(viewport={"width": 360, "height": 740})
        page.on("console", lambda line: note_error(line, troubles))
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("request", lambda each: note_foreign(each.url, base, troubles))
        yield page, base, troubles
    server.shutdown()
    server.server_close()


def note_error(line: Any, troubles: list[str]) -> None:
    """Keep what a page says of an error, and where it happened."""
    if line.type == "error":
        troubles.append(f"{line.location['url']}: {line.text}")


def note_foreign(url: str, base: str, troubles: list[str]) -> None:
    """Keep a request that goes to another host."""
    if not url.startswith((base, "data:")):
        troubles.append(f"asks for {url}")


def test_twenty_terms_find_their_page_among_the_first_three(
    browser: tuple[Any, str, list[str]],
) -> None:
    page, base, _ = browser
    missed = {}
    for term, wanted in TERMS.items():
        page.goto(f"{base}/search.html?q={term}")
        # The head line says how many pages were found once all of them are shown.
        page.wait_for_function(
            "/found/.test(document.querySelector('.search-summary')?.textContent)"
        )
        links = page.eval_on_selector_all(
            "#search-results ul.search > li > a", "links => links.slice(0, 3).map(a => a.pathname)"
        )
        names = [Path(link).stem for link in links]
        if not set(names) & set(wanted):
            missed[term] = names
    assert missed == {}


def test_every_page_reads_on_a_narrow_screen_and_asks_no_other_host(
    browser: tuple[Any, str, list[str]], site: Path
) -> None:
    page, base, troubles = browser
    troubles.clear()
    wide = {}
    for path in sorted(site.rglob("*.html")):
        if path.name in {"genindex.html", "py-modindex.html"}:
            continue
        page.goto(f"{base}/{path.relative_to(site).as_posix()}")
        width = page.evaluate("document.documentElement.scrollWidth")
        if width > 360:
            wide[path.name] = width
    assert wide == {}
    assert troubles == []
