"""The server under a drill: a real one in a separate process, with its metrics."""

import json
import math
import signal
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from prometheus_client.parser import text_string_to_metric_families

from race_server.competition.launch import (
    START_S,
    ProcessGroup,
    free_address,
    free_port,
    process_group,
)
from race_server.core.messages import Phase
from race_server.errors import RaceError
from race_server.logs import last_words

SESSION = "drill"
Figures = dict[str, float]
# Missed ticks that other load may cause on any machine, even if the quiet time has none.
SPARE = 0.001


def wait_until(is_so: Callable[[], bool], timeout_s: float, what: str) -> None:
    """Wait for a condition.

    Raises:
        RaceError: it does not come true in time.
    """
    deadline = time.monotonic() + timeout_s
    while not is_so():
        if time.monotonic() > deadline:
            raise RaceError(f"{what} did not happen within {timeout_s:g} s")
        time.sleep(0.05)


@dataclass
class ServerProcess:
    """A running server, and the processes of its drivers."""

    address: str
    port: int  # of its metrics
    place: Path
    group: ProcessGroup
    server: subprocess.Popen[bytes]
    log: Any

    def figures(self) -> Figures:
        """Return the server's metrics, labels in braces as Prometheus writes them.

        Raises:
            RaceError: the server does not answer.
        """
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        try:
            with opener.open(f"http://127.0.0.1:{self.port}/metrics", timeout=10.0) as answer:
                text = answer.read().decode()
        except (urllib.error.URLError, OSError) as error:
            raise RaceError(
                f"the server shows no metrics ({error}): {self.last_words()}"
            ) from error
        return {
            _name_of(sample.name, sample.labels): sample.value
            for family in text_string_to_metric_families(text)
            for sample in family.samples
        }

    def wait_for(self, phase: Phase) -> None:
        """Wait until the race is in a phase.

        Raises:
            RaceError: it does not reach the phase in time, or the server ends.
        """

        def is_there() -> bool:
            if self.server.poll() is not None:
                raise RaceError(f"the server has ended: {self.last_words()}")
            try:
                return self.figures().get("race_phase") == phase
            except RaceError:
                return False  # it is still starting

        wait_until(is_there, START_S, f"phase {phase.name.lower()}")

    def drive(self, name: str, seat: int) -> None:
        """Start a driver in a separate process."""
        words = ["drive", name, "--connect", self.address, "--session", SESSION]
        self.group.start([*words, "--seat", str(seat), "--patience", str(START_S)], self.log)

    def stop(self) -> dict[str, Any]:
        """End the race and return the result that the server writes.

        Raises:
            RaceError: it writes none.
        """
        if self.server.poll() is None:
            self.server.send_signal(signal.SIGTERM)
        try:
            self.server.wait(15.0)
        except subprocess.TimeoutExpired as error:
            raise RaceError("the server does not end on SIGTERM") from error
        result = self.place / "result.json"
        if not result.exists():
            raise RaceError(f"the race ended without a result: {self.last_words()}")
        document: dict[str, Any] = json.loads(result.read_text())
        return document

    def text(self) -> str:
        """Return the output of server and drivers."""
        return (self.place / "log").read_text(errors="replace")

    def last_words(self) -> str:
        """Return the last lines of the output."""
        return last_words(self.place / "log", 3)


@contextmanager
def server_process(
    words: Sequence[str],
    *,
    is_guarded: bool = False,
    environment: Mapping[str, str] | None = None,
) -> Iterator[ServerProcess]:
    """Serve one race; all processes end with the block.

    words: more arguments of ``race serve``; environment: None for that of this process.
    """
    with tempfile.TemporaryDirectory(prefix="drill-") as folder, process_group() as group:
        place, address, port = Path(folder), free_address(), free_port()
        with (place / "log").open("wb") as log:
            guard = "--guard" if is_guarded else "--no-guard"
            serve = ["serve", "--once", guard, "--fresh", "--session", SESSION]
            serve += ["--listen", address, "--metrics", str(port), "--results", "none"]
            serve += ["--result", str(place / "result.json"), *words]
            server = group.start(serve, log, environment=environment)
            yield ServerProcess(address, port, place, group, server, log)


def quantile(before: Figures, after: Figures, name: str, share: float) -> float | None:
    """Return the upper end of the bin that holds a quantile of a histogram.

    None if nothing was counted in between, infinity beyond the last bin.
    """
    prefix = f"{name}_bucket{{le="
    bins = sorted(
        (float(key[len(prefix) + 1 : -2]), value - before.get(key, 0.0))
        for key, value in after.items()
        if key.startswith(prefix)
    )
    total = bins[-1][1] if bins else 0.0
    return next((end for end, count in bins if count >= share * total), None) if total else None


def ticks_between(before: Figures, after: Figures) -> tuple[float, float]:
    """Return the number of ticks between two readings, and of missed ticks."""
    driven, missed = "race_ticks_total", "race_ticks_missed_total"
    return after[driven] - before[driven], after[missed] - before[missed]


def excess_of_missed(quiet: tuple[Figures, Figures], attacked: tuple[Figures, Figures]) -> str:
    """Return in a sentence how many ticks too many were missed under an attack, "" for none.

    The share of a quiet time of the same race is the yardstick.
    """
    calm, calm_missed = ticks_between(*quiet)
    ticks, missed = ticks_between(*attacked)
    allowed = (calm_missed / max(calm, 1.0) + SPARE) * ticks
    if missed <= allowed:
        return ""
    return f"{missed:.0f} of {ticks:.0f} ticks were missed, {allowed:.0f} are allowed"


def tick_times_between(
    before: Figures, after: Figures, histograms: Mapping[str, str]
) -> dict[str, float | None]:
    """Return quantiles of tick times between two readings; times are upper ends of bins.

    histograms: names in the server's metrics, by the name of the figure.
    """
    ticks, missed = ticks_between(before, after)
    return {
        "ticks": round(ticks),
        "missed_ticks": round(missed),
        "missed_share": round(missed / max(ticks + missed, 1.0), 5),
        **{
            f"{name}_p{round(100 * share)}_ms": milliseconds(quantile(before, after, key, share))
            for name, key in histograms.items()
            for share in (0.5, 0.99)
        },
    }


def milliseconds(seconds: float | None) -> float | None:
    """Return seconds in milliseconds, None beyond the last bin."""
    return None if seconds is None or math.isinf(seconds) else round(1e3 * seconds, 3)


def _name_of(name: str, labels: Mapping[str, str]) -> str:
    inner = ",".join(f'{label}="{value}"' for label, value in labels.items())
    return f"{name}{{{inner}}}" if inner else name
