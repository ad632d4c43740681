"""Lines that a training shows are computed before its worlds are built, and told of."""

from pathlib import Path

import pytest

from race_agents.reproductions.report_a import KARTS
from race_agents.training.lines import find_lines_shown
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import training_task
from race_server.envs.task import Task

COURSE = "generated:circuit:111"


def task(*changes: str, course: str = COURSE) -> Task:
    names = f'tracks.names=["{course}"]'
    return training_task(read_settings("full", ["tracks.set=none", names, *changes]))


@pytest.mark.parametrize("course", [COURSE, f"{COURSE}-reversed"])
def test_fields_of_several_sizes_share_the_line_of_a_course(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, course: str
) -> None:
    monkeypatch.setenv("RACE_SERVER_CACHE", str(tmp_path))
    said: list[str] = []
    shown = task("race.fields=[8, 4, 1]", course=course)
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


def test_a_lot_has_no_line_even_where_another_driver_there_could_see_one() -> None:
    parking = training_task(read_settings("report-a", [*KARTS]))
    assert parking.wants_line  # the policy of the other karts evades by all that is around it
    said: list[str] = []
    find_lines_shown([parking], 1, said.append)
    assert said == []
