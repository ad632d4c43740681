"""Drivers that a server keeps apart: which these are, and that one that hangs stops only itself."""

import io
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.errors import DriverError
from race_server.live.driver_processes import DriverProcesses, is_trusted, preset_of
from race_server.live.server import RaceServer
from race_server.logs import Log
from race_server.net.transport import ServerLink
from support.servers import running
from support.sessions import session_on_ring

HANGING = """
import ctypes
class Hanging:
    preset = "line"
    def reset(self, briefing): pass
    def act(self, observation): ctypes.PyDLL(None).pause()
"""


@pytest.mark.parametrize(
    ("name", "inside"),
    [("avoider", True), ("learned:race-1", False), ("unstuck:avoider", False), ("other", False)],
)
def test_drivers_of_ours_that_read_no_file_run_inside(name: str, inside: bool) -> None:
    assert is_trusted(name) is inside


@pytest.fixture
def hanging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Install a driver that never returns, for other processes than this one; return its name."""
    about = tmp_path / "foreign-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign\nVersion: 1\n")
    (about / "entry_points.txt").write_text("[race_server.drivers]\nhanging = foreign:Hanging\n")
    (tmp_path / "foreign.py").write_text(HANGING)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return "hanging"


@contextmanager
def serving(log: io.StringIO, *fillers: str) -> Iterator[RaceServer]:
    """Return a server on a ring in real time whose seats these drivers fill."""
    address, session = free_address(), session_on_ring("test", karts=2, countdown_s=0.1)

    def command(name: str, seat: int) -> list[str]:
        return ["drive", name, "--connect", address, "--session", "test", "--seat", str(seat)]

    with (
        ServerLink(address, "test", 2, real_time=True) as link,
        DriverProcesses(command, Log(stream=log)) as processes,
    ):
        yield RaceServer(session, link, fillers=fillers, processes=processes)


@pytest.mark.live
def test_a_driver_that_hangs_stops_its_kart_and_no_other(hanging: str) -> None:
    with serving(io.StringIO(), hanging, "pure_pursuit") as server, running(server):
        deadline = time.monotonic() + 40.0
        while server.counters.silent[0] < 60 and time.monotonic() < deadline:
            time.sleep(0.05)
        assert server.counters.silent[0] >= 60  # a second without a control of the one that hangs
        assert server.counters.silent[1] == 0
        assert server.counters.stillness(1.0) == ""
        assert server.session.seats[1].sequence >= 20  # the other one drives


@pytest.mark.live
def test_a_driver_that_cannot_start_is_named_and_the_race_begins_without_it() -> None:
    said = io.StringIO()
    with serving(said, "other", "pure_pursuit") as server, running(server):
        deadline = time.monotonic() + 40.0
        while not server.session.is_on and time.monotonic() < deadline:
            time.sleep(0.05)
        assert [seat.is_taken for seat in server.session.seats] == [False, True]
    (line,) = [json.loads(line) for line in said.getvalue().splitlines()]
    assert (line["event"], line["seat"]) == ("a driver cannot take part", 0)
    assert "driver 'other' is unknown" in line["why"]


@pytest.mark.live
def test_a_race_without_any_driver_is_refused_with_their_names() -> None:
    with (
        serving(io.StringIO(), "other") as server,
        pytest.raises(DriverError, match="no driver of other can take part"),
    ):
        server.run(0)


def test_what_a_driver_sees_is_asked_of_another_process(hanging: str) -> None:
    assert preset_of(hanging) == "line"
    with pytest.raises(DriverError, match="driver 'other' is unknown"):
        preset_of("other")
