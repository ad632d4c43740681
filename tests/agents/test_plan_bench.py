"""`race bench plan`: what it counts, gives up and refuses."""

from pathlib import Path as FilePath

import pytest
from typer.testing import CliRunner

from race_agents.planning.parking_tasks import ParkingTask
from race_agents.planning.path import Path
from race_agents.planning.plan_bench import CarYard, bench_plan
from race_server.cli.main import app
from race_server.core.kernels.geometry import Pose
from race_server.core.vehicle_presets import CAR
from race_server.errors import PlanError, ScenarioError


def test_the_yardstick_counts_what_was_solved() -> None:
    measured = bench_plan(CAR, runs=1, seed=0, text="reverse")
    rows = measured.document()["rows"]
    assert isinstance(rows, list)
    assert [row["task"] for row in rows] == [task.name for task, _ in measured.shown]
    assert [row["solved"] for row in rows] == [1, 1, 1]
    assert rows[0]["share_low"] == pytest.approx(0.2065, abs=1e-4)  # 1 / (1 + 1.96²)


def test_a_task_of_which_none_of_50_starts_is_solved_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = CarYard.plan

    def refuse(yard: CarYard, task: ParkingTask, pose: Pose) -> Path:
        if "parallel" in task.name:
            raise PlanError("no way")
        return plan(yard, task, pose)

    monkeypatch.setattr(CarYard, "plan", refuse)
    (row,) = bench_plan(CAR, runs=60, seed=0, text="1.35 L").rows
    assert (row.runs, row.solved, row.failures) == (50, 0, {"no way": 50})
    assert row.share_high == pytest.approx(0.0713, abs=1e-4)  # 1.96² / (50 + 1.96²)


def test_a_task_that_does_not_exist_is_refused_with_the_names_of_those_that_do() -> None:
    with pytest.raises(ScenarioError, match=r"is in the name of no task; .*L \+ 0.6"):
        bench_plan(CAR, runs=1, seed=0, text="canal")


def test_where_nothing_was_solved_no_picture_is_drawn(
    tmp_path: FilePath, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> Path:
        raise PlanError("no way")

    monkeypatch.setattr(CarYard, "plan", refuse)
    words = ["bench", "plan", "--runs", "1", "--task", "1.35 L", "--plot"]
    done = CliRunner().invoke(app, [*words, str(tmp_path / "plan.png")])
    assert done.exit_code == 0, done.output
    assert "nothing was solved" in done.stderr
    assert not list(tmp_path.iterdir())
