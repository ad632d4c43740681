"""Lines that a training shows are computed before its worlds are built, and told of."""

from pathlib import Path

import pytest

from race_agents.training.lines import find_lines_shown
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import training_task
from race_server.envs.task import Task

ONE_COURSE = ("tracks.set=none", 'tracks.names=["generated:circuit:111"]')


def task(*changes: str) -> Task:
    return training_task(read_settings("full", [*ONE_COURSE, *changes]))


def test_fields_of_several_sizes_share_the_line_of_a_course(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RACE_SERVER_CACHE", str(tmp_path))
    said: list[str] = []
    shown = task("race.fields=[8, 4, 1]")
    assert len(shown.scenarios) == 3
    find_lines_shown([shown], 1, said.append)
    assert said == [
        "reference lines: 1 to compute, 1 to 20 s each",
        "reference lines: 1 of 1",
    ]
    find_lines_shown([shown], 1, said.append)
    assert len(said) == 2


def test_a_task_that_shows_no_line_waits_for_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RACE_SERVER_CACHE", str(tmp_path))
    said: list[str] = []
    alone = ("race.karts=1", "race.fields=[1]", "race.opponents=[]")
    blind = task(*alone, 'observation=["lidar", "speed"]', "warm_start.teacher=none")
    assert not blind.wants_line
    find_lines_shown([blind], 1, said.append)
    assert said == []
