"""The processes of a race end with it, however it ends."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.competition import launch
from race_server.core.messages import Phase
from race_server.logs import LISTENING, Log, warnings_in

LAUNCH = """
import subprocess, time
from race_server.competition.launch import free_address, process_group

with process_group() as group:
    arguments = ["gateway", "--connect", free_address(), "--port", "0", "--recordings", "none"]
    print(group.start(arguments, subprocess.DEVNULL).pid, flush=True)
    time.sleep(60.0)
"""


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.live
def test_a_race_that_is_cut_by_ctrl_c_tells_its_result_and_ends_as_interrupted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupt(seen: Any, *_: Any) -> None:
        while seen.watcher.standings is None or seen.watcher.standings.phase is Phase.LOBBY:
            time.sleep(0.05)
        raise KeyboardInterrupt

    monkeypatch.setattr(launch, "_show", interrupt)
    words = ["start", "--track", "oval", "--karts", "1", "--laps", "1000", "--one-process"]
    words += ["--drivers", "avoider", "--no-page", "--results", "none", "--record", "none"]
    told = CliRunner().invoke(app, [*words, "--json"])
    assert told.exit_code == 130
    document = json.loads(told.stdout)
    assert document["stopped"]
    assert [kart["status"] for kart in document["karts"]] != ["finished"]


def test_warnings_of_a_log_are_those_of_the_server_itself_each_once(tmp_path: Path) -> None:
    path = tmp_path / "server.log"
    with path.open("w") as stream:
        log = Log(as_json=True, stream=stream)
        log.warn("its line is of another vehicle")  # said before
        log.say(LISTENING, address="there")
        for _ in range(2):
            log.warn("recording FILE takes no more")
        log.warn("races go on without a results file", why="the disk is full")
        log.warn("silent: its kart stands", seat=1)
        stream.write("Traceback\n[1]\n")
    assert warnings_in(path) == [
        "recording FILE takes no more",
        "races go on without a results file: the disk is full",
    ]


@pytest.mark.live
def test_what_a_race_could_not_record_stands_in_its_document(tmp_path: Path) -> None:
    words = ["start", "--track", "oval", "--karts", "1", "--laps", "1", "--one-process"]
    words += ["--drivers", "avoider", "--no-page", "--results", "none", "--pace", "lockstep"]
    done = CliRunner().invoke(app, [*words, "--record", str(tmp_path), "--json"])
    assert json.loads(done.stdout)["warnings"] == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_race_that_is_ended_by_a_signal_leaves_no_process_behind(number: signal.Signals) -> None:
    with subprocess.Popen([sys.executable, "-c", LAUNCH], stdout=subprocess.PIPE) as launcher:
        assert launcher.stdout
        gateway = int(launcher.stdout.readline())
        assert is_there(gateway)
        launcher.send_signal(number)
        assert launcher.wait(30.0) == 128 + number
    deadline = time.monotonic() + 5.0
    while is_there(gateway) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_there(gateway)
