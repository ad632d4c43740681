"""The drills as a whole, and the parts of them that need no race."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from race_server.cli import drill
from race_server.competition.launch import ProcessGroup
from race_server.tools.drills.chromium import PAGE_ERROR
from race_server.tools.drills.evening import Evening
from race_server.tools.drills.report import SmallDrill
from race_server.tools.drills.small import run_all, small_drills
from race_server.tools.drills.soak import memory_slope
from race_server.tools.drills.torn import commit_ends, is_torn

MOST_S = 480.0


def test_every_drill_takes_part_in_all_of_them_within_eight_minutes() -> None:
    commands = {
        command.name or command.callback.__name__ for command in drill.app.registered_commands
    }
    sizes = small_drills()
    # `onboard` and `faults` are of another package; they and `evening` take longer than others.
    assert set(sizes) == commands - {"all", "onboard", "faults", "evening"}
    assert sum(small.seconds for small in sizes.values()) <= MOST_S


def test_a_drill_that_fails_to_run_is_a_row_that_says_why() -> None:
    told: list[int] = []
    document = run_all({"nonesuch": SmallDrill("", 2.0, "figure")}, tell=told.append)
    (row,) = document["drills"]
    assert not document["ok"]
    assert (row["name"], row["ok"], row["figure"]) == ("nonesuch", False, "figure = None")
    assert row["why"]
    assert told[-1] == 2


def test_memory_that_gains_1_mb_in_36_s_gains_100_mb_in_an_hour() -> None:
    samples = np.array([(36.0 * turn, 200.0 + turn, 30.0, 12.0) for turn in range(5)])
    assert memory_slope(samples) == pytest.approx(100.0)


def test_a_log_is_torn_where_frames_follow_its_last_commit(tmp_path: Path) -> None:
    page = 512
    head = struct.pack(">8xI20x", page)
    frame, commit = (struct.pack(">4xI16x", pages) + bytes(page) for pages in (0, 7))
    log = tmp_path / "results.sqlite-wal"
    log.write_bytes(head + frame + commit + frame)
    assert commit_ends(log.read_bytes()) == [32 + 2 * (24 + page)]
    assert is_torn(log)
    log.write_bytes(head + frame + commit)
    assert not is_torn(log)


def test_an_error_of_a_page_is_a_fault_of_the_evening_while_a_kill_is_waited_for_too(
    tmp_path: Path,
) -> None:
    words = {"timestamp": "now", "event": PAGE_ERROR, "why": "no such seat"}
    (tmp_path / "log").write_text(json.dumps(words) + "\n")
    evening = Evening(tmp_path, ProcessGroup(), None)
    assert not any(line["event"] == "going on with an event" for line in evening.lines())
    assert evening.faults == ["an error of the page: no such seat"]
