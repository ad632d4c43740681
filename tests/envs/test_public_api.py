"""What `race_server.envs` offers: a list that users rely on, and that nothing loads too early."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from race_server import envs

EXPORTED = [
    "LEARNING_RULES",
    "REENTER",
    "RESET_WORLD",
    "STAY",
    "Batch",
    "CalledOpponent",
    "Curriculum",
    "Discipline",
    "KartRace",
    "KartVecEnv",
    "KartVectorEnv",
    "OneKart",
    "Racing",
    "RealityGap",
    "Task",
    "env",
    "mixed_task",
    "parallel_env",
    "parking_task",
    "race_task",
    "scenario_on",
    "task_on",
    "time_trial_task",
]


def test_the_exported_names_are_these() -> None:
    assert envs.__all__ == EXPORTED
    assert set(EXPORTED) <= set(dir(envs))


@pytest.mark.parametrize("name", EXPORTED)
def test_every_exported_name_is_there(name: str) -> None:
    if name == "KartVecEnv":
        pytest.importorskip("stable_baselines3")
    value = getattr(envs, name)
    assert getattr(value, "__module__", "race_server.envs").startswith(
        ("race_server.envs", "collections.abc", "typing", "race_server.scenario")
    )
    assert getattr(envs, name) is value


def test_a_name_that_is_not_exported_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"'race_server\.envs' has no attribute 'boat_env'"):
        _ = envs.boat_env


def test_type_checkers_see_what_is_exported() -> None:
    tree = ast.parse(Path(envs.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {
        each.name: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for each in node.names
    }
    homes = {name: f"race_server.envs.{module}" for name, module in envs._HOMES.items()}
    assert seen == homes
    assert sorted(seen) == sorted(EXPORTED)


IMPORTED_LATE = """
import sys
import race_server.envs as envs
for module in ("torch", "stable_baselines3", "pygame", "numba", "race_server.envs.batch"):
    assert module not in sys.modules, module
envs.Batch, envs.Task, envs.parallel_env, envs.KartVectorEnv, envs.RealityGap
for module in ("torch", "stable_baselines3", "pygame"):
    assert module not in sys.modules, module
"""


def test_nothing_is_imported_before_it_is_used() -> None:
    subprocess.run([sys.executable, "-c", IMPORTED_LATE], check=True)
