"""Serve where nothing can be written: one clear sentence, and a race wherever one is possible.

No user can write a path below a regular file, root included.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from race_server.competition.launch import START_S, free_address
from race_server.tools.drills.report import Finding, SmallDrill, matrix_of

SMALL = SmallDrill("", 8, "acts")
_RACE = (
    *("serve", "--once", "--no-guard", "--fresh", "--track", "oval-report", "--karts", "2"),
    *("--laps", "1", "--pace", "lockstep", "--fill", "pure_pursuit", "--wait-for", "0"),
    *("--session", "drill", "--json"),
)
_NOWHERE = ("--record", "none", "--results", "none")


def drill_readonly() -> dict[str, Any]:
    """Serve with each place in turn unwritable, and return what was said and raced."""
    with tempfile.TemporaryDirectory(prefix="drill-") as name:
        file = Path(name, "file")
        file.touch()
        below = str(file / "folder")
        results = ("--results", f"{below}/results.sqlite")
        findings = [
            _is_refused("recordings", ("--record", below, "--results", "none"), "--record none"),
            _is_refused("results file", ("--record", "none", *results), "--results none"),
            _races_on("steward's token", {"XDG_RUNTIME_DIR": below}, "races have no steward"),
        ]
    return matrix_of(findings, acts=len(findings))


def _serve(options: tuple[str, ...], environment: dict[str, str]) -> tuple[int, str, list[str]]:
    """Return exit status, document and log lines of a race served with these options."""
    done = subprocess.run(
        [sys.executable, "-m", "race_server", *_RACE, "--listen", free_address(), *options],
        env={**os.environ, **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=START_S,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr.splitlines()


def _is_refused(what: str, options: tuple[str, ...], way_out: str) -> Finding:
    """Serve to a place that the command names: the server must not start, and say the way out."""
    status, _, said = _serve(options, {})
    complaints = [line for line in said if line.startswith("error: ")]
    is_clear = status == 2 and len(complaints) == len(said) == 1 and way_out in complaints[0]
    seen = "refused with one sentence" if is_clear else f"exit {status}: {said[-3:]}"
    return Finding(f"{what} below a file", "refused with one sentence", seen, is_clear)


def _races_on(what: str, environment: dict[str, str], sentence: str) -> Finding:
    """Serve with a place of the server's own that cannot be written: it must race without."""
    status, document, said = _serve(_NOWHERE, environment)
    times = sum(sentence in line for line in said)
    is_well = status == 0 and '"laps": 1' in document and times == 1
    seen = "raced, said once" if is_well else f"exit {status}, said {times} times: {said[-3:]}"
    return Finding(f"{what} below a file", "raced, said once", seen, is_well)
