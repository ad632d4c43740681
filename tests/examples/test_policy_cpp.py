"""The example in C++ answers like Python; skipped where ONNX Runtime has no header."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from race_server.cli.main import app
from support.trainings import write_lapping_policy

EXAMPLE = Path(__file__).parents[2] / "examples" / "policy_cpp"


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the example; $ONNXRUNTIME_ROOT says where ONNX Runtime lies, if not in the system."""
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed")
    place = tmp_path_factory.mktemp("policy_cpp")
    root = f"-DONNXRUNTIME_ROOT={os.environ.get('ONNXRUNTIME_ROOT', '')}"
    command = ["cmake", "-S", str(EXAMPLE), "-B", str(place), root]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    if "ONNXRUNTIME_" in found.stderr:
        pytest.skip("ONNX Runtime's header and library are not installed: libonnxruntime-dev")
    assert found.returncode == 0, found.stderr
    subprocess.run(["cmake", "--build", str(place)], capture_output=True, check=True)
    return place / "policy"


def test_a_policy_answers_in_cpp_what_it_answers_in_python(program: Path, tmp_path: Path) -> None:
    policy, observation = tmp_path / "lapping.onnx", tmp_path / "observation.txt"
    write_lapping_policy(policy)
    words = ["policy", "check", str(policy), "--observations", "160", "--example", str(observation)]
    checked = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    command = [str(program), str(policy), str(observation)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    metadata, action, times = done.stdout.splitlines()
    assert json.loads(metadata.removeprefix("race-server-policy: "))["vehicle"] == "tt02"
    answer = [float(word) for word in action.removeprefix("action:").split()]
    assert answer == pytest.approx(checked["example"]["action"], abs=1e-5)
    assert times.startswith("decision: ")


def test_an_observation_of_another_size_is_refused(program: Path, tmp_path: Path) -> None:
    policy, observation = tmp_path / "lapping.onnx", tmp_path / "observation.txt"
    write_lapping_policy(policy)
    observation.write_text("1.0\n2.0\n")
    command = [str(program), str(policy), str(observation)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "2 numbers, the policy takes 22" in done.stderr
