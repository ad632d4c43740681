"""Hostile files: each must be refused in one sentence, quickly and in little memory."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from race_server.tools.drills.bombs import BOMBS, Bomb
from race_server.tools.drills.report import Finding, SmallDrill, matrix_of

SMALL = SmallDrill("", 15, "files")

# Beyond what starting the command costs.
MOST_CPU_S, MOST_MEMORY_MB = 2.0, 400.0
# The process is ended then.
PATIENCE_S = 60.0
EXPECTED = "refused in one sentence"
# Of the command line, for errors of ours.
REFUSED = 2


def drill_files(tell: Callable[[int], None] = lambda _: None) -> dict[str, Any]:
    """Have the command line read hostile files and return the findings."""
    findings = []
    with tempfile.TemporaryDirectory(prefix="race-drill-") as name:
        start_s, _, _, _ = _run(["recording", "info", str(Path(name, "none.mcap"))])
        for number, bomb in enumerate(BOMBS):
            findings.append(_try(bomb, Path(name), start_s))
            tell(number + 1)
    return matrix_of(findings, files=len(findings), start_s=round(start_s, 2))


def _try(bomb: Bomb, folder: Path, start_s: float) -> Finding:
    cpu_s, memory_mb, code, said = _run(bomb.write(folder))
    lines = said.strip().splitlines()
    is_refused = code == REFUSED and len(lines) == 1 and lines[0].startswith("error: ")
    is_cheap = cpu_s - start_s <= MOST_CPU_S and memory_mb <= MOST_MEMORY_MB
    outcome = EXPECTED if is_refused else f"exit code {code}: {said[-80:]!r}"
    seen = f"{outcome}, {cpu_s:.1f} s of CPU, {memory_mb:.0f} MB"
    return Finding(bomb.name, EXPECTED, seen, is_refused and is_cheap)


def _run(words: list[str]) -> tuple[float, float, int, str]:
    """Run a command; return CPU time [s], peak memory [MB], exit code and what it said."""
    command = ["timeout", "-s", "KILL", f"{PATIENCE_S:g}", sys.executable, "-m", "race_server"]
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(
            [*command, *words],
            stdout=said,
            stderr=subprocess.STDOUT,
            env={**os.environ, "COLUMNS": "1000"},
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        text = said.read().decode(errors="replace")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3, process.returncode, text
