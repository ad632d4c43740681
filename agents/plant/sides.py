"""The game's side of a kart is killed at speed: how soon do the brakes begin?

A whole kart races: a server, the game's side with its link, and the safety side in a process of its
own, which kills the other one as `kill -9` does and measures by its own clock what happens then.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from race_agents.plant.row import Row
from race_agents.plant.whereabouts import Setting
from race_server.competition.launch import free_address
from race_server.errors import DriverError

KMH = 50.0
BAR_S = 0.2  # the brakes have to begin within this time
BEGUN_S, DONE_S = 90.0, 90.0  # until the kart is that fast, and has written what it did
COURSE, VEHICLE = "colline-1100", "kart-60"


def rows(setting: Setting) -> list[Row]:
    """Return the table of a lost side: the worst of some karts as built, one for each seed."""
    found = []
    for seed in range(setting.seeds):
        found.append(lose_game(seed + 1))
        setting.tell()
    begun = [each["braked_after_s"] for each in found]
    note = (
        f"{sum(each <= BAR_S for each in begun)} of {len(begun)} within that, median "
        f"{median(begun):.3f} s, at {min(each['speed'] for each in found) * 3.6:.0f} km/h or more"
    )
    return [
        Row(
            "brakes begin after the game's side was killed (kill -9) at 50 km/h",
            "s",
            max(begun),
            most=BAR_S,
            note=note,
        ),
        Row(
            "the kart stands after that",
            "s",
            max(each["stood_after_s"] for each in found),
            # 60 % of the certain braking, and what passes before it.
            most=round(0.4 + KMH / 3.6 / (0.6 * 5.15), 1),
            note=f"within {max(each['stopped_within_m'] for each in found):.0f} m",
        ),
    ]


def lose_game(seed: int) -> dict[str, Any]:
    """Race with one kart until its game's side is killed; return the figures of its stop.

    Raises:
        DriverError: the kart left no figures.
    """
    address = free_address()
    with tempfile.TemporaryDirectory(prefix="race-drill-") as folder:
        report = Path(folder, "kart.json")
        race = ["serve", "--track", COURSE, "--vehicle", VEHICLE, "--karts", "1", "--wait-for", "1"]
        race += ["--laps", "2", "--listen", address, "--results", "none", "--items", "off"]
        kart = ["plant", "--driver", "raceline", "--connect", address, "--patience", "120"]
        kart += ["--seed", str(seed), "--kill-game-at", str(KMH), "--report", str(report)]
        programs = [_run(race), _run(kart)]
        try:
            _wait_for(report, programs[1])
            figures: dict[str, Any] = json.loads(report.read_text())["game_loss"]
        finally:
            for program in reversed(programs):
                program.terminate()
                program.wait(10.0)
    if "stood_after_s" not in figures:
        raise DriverError(f"the kart did not get as fast as {KMH:g} km/h, or did not stop")
    return figures


def _run(arguments: list[str]) -> "subprocess.Popen[bytes]":
    environment = {**os.environ}
    environment.pop("RACE_SERVER_INTERPRET", None)
    return subprocess.Popen(
        [sys.executable, "-m", "race_server", *arguments],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _wait_for(report: Path, kart: "subprocess.Popen[bytes]") -> None:
    """Wait until the kart's program is killed, and its safety side has written its report."""
    deadline = time.monotonic() + 120.0 + BEGUN_S + DONE_S
    while not (report.exists() and report.read_text().endswith("}")):
        if time.monotonic() > deadline or kart.poll() not in {None, -9}:
            raise DriverError(f"the kart of the drill left no report: {kart.poll()}")
        time.sleep(0.2)
