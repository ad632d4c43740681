"""Runs the blocks of code in a page, in order, in one folder.

Sybil finds and runs them. Python blocks of a page share their names. Of a console block each line
that begins with `$ ` is a command, and must end with 0; the lines below it, if there are any, are
its output, where `...` stands for anything. A TOML block must be settings of a training.
"""

import os
import re
import socket
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sybil import Document, Example
from sybil.parsers.myst import CodeBlockParser, PythonCodeBlockParser

from race_docs.checks import RUN
from race_docs.pages import ROOT, Block, Page

ADDRESS = "127.0.0.1:7447"
COMMAND_LIMIT_S = 240.0


class Console(CodeBlockParser):
    """Commands and what they print."""

    language = "console"

    def evaluate(self, example: Example) -> str | None:
        """Run each command; return what is wrong with the first that fails."""
        for command, expected in _commands(str(example.parsed)):
            done = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", command],
                capture_output=True,
                text=True,
                env=environment(),
                timeout=COMMAND_LIMIT_S,
                check=False,
            )
            if done.returncode:
                return f"`{command}` ended with {done.returncode}:\n{done.stdout}{done.stderr}"
            if expected and not _fits(done.stdout, expected):
                return f"`{command}` printed\n{done.stdout}\nand not\n{expected}"
        return None


class Settings(CodeBlockParser):
    """Parts of a TOML file of a training."""

    language = "toml"

    def evaluate(self, example: Example) -> str | None:
        """Check the settings; a part that names no time trains for a minute."""
        from race_agents.training.settings_toml import settings_of

        words = tomllib.loads(str(example.parsed))
        settings_of({"minutes": 1.0} | words, Path(example.path).name)
        return None


def environment() -> dict[str, str]:
    """Return the environment of a command: the `race` of this Python, and files kept here."""
    here = str(Path.cwd())
    return os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}",
        "RACE_SERVER_RESULTS": f"{here}/results.sqlite",
        "RACE_SERVER_RECORDINGS": f"{here}/recordings",
        "XDG_RUNTIME_DIR": here,
        "COLUMNS": "100",
        "NO_COLOR": "1",
    }


def run_page(page: Page, folder: Path, address: str) -> int:
    """Run the blocks of a page in a folder and return how many were run.

    address: host and port that take the place of the default ones.

    Raises:
        SybilFailure: a block is not what it says.
    """
    blocks = {block.line: block for block in page.blocks()}
    copy = folder / Path(page.path).name
    copy.write_text(page.text.replace(ADDRESS, address), encoding="utf-8")
    document = Document.parse(str(copy), PythonCodeBlockParser(), Console(), Settings())
    count = 0
    with _inside(folder):
        for example in document.examples():
            block = blocks[example.line]
            if not block.reason:
                with _beside(block, address):
                    example.evaluate()
                count += 1
    return count


def runnable(page: Page) -> list[Block]:
    """Return the blocks of a page that are run."""
    return [block for block in page.blocks() if block.language in RUN and not block.reason]


@contextmanager
def _beside(block: Block, address: str) -> Iterator[None]:
    """Let the command run that a block needs beside it, and end it afterwards."""
    if not block.beside:
        yield
        return
    command = block.beside.replace(ADDRESS, address)
    with subprocess.Popen(
        ["bash", "-c", f"exec {command}"],
        env=environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            _wait_for(address, process)
            yield
        finally:
            process.terminate()


def _wait_for(address: str, process: subprocess.Popen[bytes]) -> None:
    """Wait until something listens at an address; a server compiles before it does."""
    host, _, port = address.rpartition(":")
    deadline = time.monotonic() + COMMAND_LIMIT_S
    while process.poll() is None and time.monotonic() < deadline:
        with suppress(OSError), socket.create_connection((host, int(port)), timeout=1.0):
            return
        time.sleep(0.2)


@contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def _commands(text: str) -> list[tuple[str, str]]:
    """Return the commands of a block, each with the output that is expected."""
    found: list[tuple[str, str]] = []
    for line in text.splitlines():
        if line.startswith("$ "):
            found.append((line.removeprefix("$ "), ""))
        elif found and found[-1][0].endswith("\\"):
            found[-1] = (found[-1][0].removesuffix("\\") + line, "")
        elif found:
            found[-1] = (found[-1][0], f"{found[-1][1]}{line}\n")
    return found


def _fits(printed: str, expected: str) -> bool:
    """Return whether an output is as expected, blank space aside; `...` stands for anything."""
    parts = [re.escape(" ".join(part.split())) for part in expected.split("...")]
    return re.fullmatch(".*".join(parts), " ".join(printed.split()), re.DOTALL) is not None


def counts(pages: list[Page]) -> tuple[int, int]:
    """Return how many blocks of code are run, and how many say why they are not."""
    reasons = [block for page in pages for block in page.blocks() if block.reason]
    return sum(len(runnable(page)) for page in pages), len(reasons)


if __name__ == "__main__":
    from race_docs.pages import all_pages

    ran, left_out = counts(all_pages(ROOT))
    print(f"{ran} blocks of code are run, {left_out} are not, each with its reason")
