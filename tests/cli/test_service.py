"""Servers of one race that replace one which was killed at its end."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.cli.service import serve_races
from race_server.logs import Log
from support.served_race import one_race

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("handlers")]


@pytest.mark.parametrize("is_filed", [True, False], ids=["filed away", "not yet"])
def test_a_race_whose_server_was_killed_before_its_result_is_not_driven_again(
    tmp_path: Path, is_filed: bool
) -> None:
    result = tmp_path / "result.json"
    service = replace(one_race(result), results="none", record=str(tmp_path))
    serve_races(service, Log(stream=io.StringIO()), fresh=False)
    (recording,) = tmp_path.glob("*.mcap")
    driven = json.loads(result.read_text())
    result.unlink()
    if not is_filed:
        recording.rename(tmp_path / "cup.journal.mcap")
    said = io.StringIO()
    serve_races(service, Log(stream=said), fresh=False, replaces=True)
    again = json.loads(result.read_text())
    assert again == driven
    assert list(tmp_path.glob("*.mcap")) == [recording]
    assert [json.loads(line)["event"] for line in said.getvalue().splitlines()] == [
        "the race was over"
    ]


def test_a_race_of_another_evening_and_a_result_that_is_there_stay_as_they_are(
    tmp_path: Path,
) -> None:
    result = tmp_path / "result.json"
    service = replace(one_race(result), results="none", record=str(tmp_path))
    serve_races(service, Log(stream=io.StringIO()), fresh=False)
    result.write_text("amended")
    serve_races(service, Log(stream=io.StringIO()), fresh=False, replaces=True)
    assert result.read_text() == "amended"
    later = replace(service, begun_at="2999-01-01T00:00:00.000+00:00")
    serve_races(later, Log(stream=io.StringIO()), fresh=False, replaces=True)
    assert len(list(tmp_path.glob("*.mcap"))) == 2
