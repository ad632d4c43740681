"""The examples in Python run from beginning to end, in a short setting."""

import runpy
import subprocess
import sys
import time
from itertools import chain, repeat
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_no_example_in_python_is_left_out() -> None:
    names = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert names == ["timing_board.py", "train_sb3.py"]


@pytest.mark.parametrize("address", ["http://127.0.0.1:9", "127.0.0.1:8080", "http://[", "x"])
def test_the_board_says_in_one_line_that_no_gateway_is_there(address: str) -> None:
    board = [sys.executable, str(EXAMPLES / "timing_board.py"), address]
    done = subprocess.run(board, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"error: {address}: no timing (")
    assert "such as http://127.0.0.1:8080" in line


@pytest.mark.slow
@pytest.mark.timeout(300)  # a first start compiles
def test_the_example_of_sb3_prints_what_it_learned_and_saves_its_policy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sb3 = pytest.importorskip("stable_baselines3")
    import race_server.envs.sb3  # noqa: F401  # imported with the real clock

    # For this script, and for nothing else, a minute is over after the first 32,768 decisions.
    clock = ModuleType("time")
    vars(clock).update(vars(time))
    vars(clock)["monotonic"] = chain((0.0, 1.0), repeat(61.0)).__next__
    monkeypatch.setitem(sys.modules, "time", clock)
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / "train_sb3.py"), run_name="__main__")
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("32768 decisions: ")
    assert sb3.PPO.load(tmp_path / "kart.zip", device="cpu").num_timesteps == 32_768
