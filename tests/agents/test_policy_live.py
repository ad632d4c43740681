"""A learned driver in a live race, in a separate process without PyTorch."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Status
from race_server.live.server import REAL, RaceServer
from race_server.net.transport import ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.session.session import Session
from support.courses import ring
from support.servers import running
from support.trainings import write_lapping_policy

pytestmark = pytest.mark.live

# What only training needs cannot be imported where this lies first on the path.
BLOCKER = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"torch", "stable_baselines3", "onnx"}:
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocker())
"""


@pytest.fixture
def without_pytorch(tmp_path: Path) -> dict[str, str]:
    """Return the environment of a process that has nothing that only training needs."""
    (tmp_path / "sitecustomize.py").write_text(BLOCKER)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-c", "import torch"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert "torch is blocked" in done.stderr
    return environment


def test_a_learned_driver_without_pytorch_laps_and_misses_no_decision(
    without_pytorch: dict[str, str], tmp_path: Path
) -> None:
    policy = tmp_path / "lapping.onnx"
    write_lapping_policy(policy)
    rules = Rules(laps=1, countdown_s=0.5, items=False, limit_s=30.0)
    session = Session("race", Scenario(ring(2.0, 0.7), karts=1, rules=rules))
    address = free_address()
    with ServerLink(address, "race", 1) as link:
        server = RaceServer(session, link, REAL)
        words = ["drive", f"learned:{policy}", "--connect", address, "--json"]
        command = [sys.executable, "-m", "race_server", *words]
        with running(server, drivers=1) as live:
            done = subprocess.run(
                command,
                env=without_pytorch,
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    (result,) = live.results
    assert result.standings[0].status is Status.FINISHED
    assert (told["laps"], told["outcome"]) == (1, "finished")
    # It heard every observation, the server took every answer, and none was so late that the kart
    # was left to coast.
    assert told["missing"] == server.counters.lost[0] == 0
    assert server.counters.controls[0] >= told["observations"] - 1
    assert server.counters.silent == [0]


def test_the_command_line_loads_no_compiler_before_it_knows_the_command() -> None:
    # A driver's process interprets its kernels: it starts in a second and never waits for numba.
    # All others start in half the time without numpy.
    program = "import race_server.cli.main, sys; print({'numba', 'numpy'} & set(sys.modules))"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
