"""The Sphinx extension: writes the generated pages and turns findings into warnings."""

import importlib
import os
import re
import shutil
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util import logging

from race_docs.api import api_page, errors_page
from race_docs.checks import NO_CODE, Facts, check
from race_docs.commands import command_tree, commands_page
from race_docs.messages import messages_page
from race_docs.pages import BROUGHT, ROOT, all_pages
from race_docs.settings import settings_page

logger = logging.getLogger(__name__)

GENERATED = "generated"
PACKAGES = ("race_server", "race_server.envs")
# Code that is a command or a public name and nothing more, outside of a link.
_CODE = re.compile(r"(?<![`\[\w}])`(race(?: [a-z]+)+|race_server(?:\.\w+)+)`(?![`\]])")
# Folders that a page stands for.
FOLDERS = {"schemas": "messages"}
_LINK = re.compile(r"(!?\[[^\]]*\]\()([^)#\s]+)(#[^)\s]*)?\)")


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension."""
    app.connect("builder-inited", _write_pages)
    app.connect("builder-inited", _check_pages)
    app.connect("source-read", _read_source)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _write_pages(app: Sphinx) -> None:
    """Write all generated pages again."""
    facts = Facts()
    folder = Path(app.srcdir) / GENERATED
    packages = [importlib.import_module(name) for name in PACKAGES]
    pages = {
        "commands": commands_page(facts.commands),
        "settings": settings_page(),
        "messages": messages_page(),
        "api": api_page(*(each for each in packages if hasattr(each, "__all__"))),
        "errors": errors_page(),
    }
    for source, name in BROUGHT.items():
        pages[name] = _moved((ROOT / source).read_text(encoding="utf-8"), source, folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, text in pages.items():
        (folder / f"{name}.md").write_text(text, encoding="utf-8")


def _moved(text: str, source: str, target: Path) -> str:
    """Return a page with links that lead to the same places from where it stands on the site.

    source: the page's file, from the root; target: the folder in which the site has it.
    """

    def moved(match: re.Match[str]) -> str:
        begin, link, anchor = match[1], match[2], match[3] or ""
        if "://" in link or link.startswith("mailto:"):
            return match[0]
        place = os.path.normpath((ROOT / source).parent / link)
        there = Path(place).relative_to(ROOT).as_posix()
        name = BROUGHT.get(there) or FOLDERS.get(there)
        if name:
            place = str(ROOT / "docs" / GENERATED / f"{name}.md")
        return f"{begin}{os.path.relpath(place, target)}{anchor})"

    return _LINK.sub(moved, text)


def _check_pages(_: Sphinx) -> None:
    """Warn of everything that a page names and that does not exist; count the blocks."""
    facts = Facts()
    counts: Counter[str] = Counter()
    for page in all_pages():
        for finding in check(page, facts):
            logger.warning(finding.message, location=f"{finding.page}:{finding.line}")
        for block in page.blocks():
            if block.language not in NO_CODE:
                counts["not run" if block.reason else "run"] += 1
    logger.info(
        "blocks of code: %d are run by the tests, %d say why not", counts["run"], counts["not run"]
    )


def _read_source(app: Sphinx, name: str, source: list[str]) -> None:
    """Take observations from the definitions, and let code that names a command lead to it."""
    if name == "observations":
        from race_server.envs.docs import manual

        source[0] = manual()
    elif not name.startswith(f"{GENERATED}/"):
        source[0] = _moved(source[0], f"docs/{name}.md", Path(app.srcdir, name).parent)
    if name != f"{GENERATED}/commands":
        source[0] = _linked(source[0])


def _linked(text: str) -> str:
    """Return a page in which `race trial` and `race_server.KartClient` lead to the reference."""
    lines, fence = [], ""
    for line in text.splitlines():
        if fence:
            fence = "" if line.strip() == fence else fence
        elif line.startswith("```"):
            fence = line[: len(line) - len(line.lstrip("`"))]
        elif not line.startswith("#"):
            line = _CODE.sub(_reference, line)
        lines.append(line)
    return "\n".join(lines) + "\n"


def _reference(match: re.Match[str]) -> str:
    code = match[1]
    if tuple(code.split()[1:]) in _commands():
        return f"[`{code}`](#{'-'.join(code.split())})"
    package, _, public = code.rpartition(".")
    if package in PACKAGES and public in getattr(importlib.import_module(package), "__all__", ()):
        return f"{{py:obj}}`{code}`"
    return match[0]


@cache
def _commands() -> set[tuple[str, ...]]:
    return {words for words in command_tree() if words}
