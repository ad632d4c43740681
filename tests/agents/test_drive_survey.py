"""A course made of the sensors of a drive, against the course that was driven."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from race_agents.commands.track_survey import sensor_log_of, survey
from race_agents.planning.drive_survey import survey_drive
from race_agents.training.demonstrations import Demonstrations, write_demonstrations
from race_agents.training.demonstrator import demonstrate
from race_server.core.vehicle_presets import TT02
from race_server.errors import PlanError, RecordingError
from race_server.scenario.track.load import load_course

app = typer.Typer()
app.command()(survey)


@cache
def a_lap_of_the_oval() -> Demonstrations:
    return demonstrate("follow_gap", ["oval"], "tt02", 1, 1, 0.0)[0]


def asked(drive: Path, to: Path) -> dict[str, object]:
    shown = CliRunner().invoke(app, [str(drive), "--to", str(to), "--json"], catch_exceptions=False)
    return dict(json.loads(shown.stdout))


def test_a_lap_of_the_oval_gives_its_length_to_1_percent_and_its_width_to_5_cm(
    tmp_path: Path,
) -> None:
    write_demonstrations(tmp_path / "lap.npz", a_lap_of_the_oval())
    figures = asked(tmp_path / "lap.npz", tmp_path / "ring.toml")
    found, true = load_course(str(tmp_path / "ring.toml")), load_course("oval")
    assert found.length == pytest.approx(true.length, rel=0.01)
    widths = found.half_widths.sum(axis=1)
    assert widths == pytest.approx(np.full(len(widths), true.width_mean), abs=0.05)
    assert figures["scale"] == "1/10"
    assert figures["length_m"] == pytest.approx(found.length, abs=1e-3)
    assert "Surveyed from lap.npz" in (tmp_path / "ring.toml").read_text()


def test_half_a_lap_closes_nowhere_and_says_so(tmp_path: Path) -> None:
    whole = a_lap_of_the_oval()
    half = replace(whole, observations=whole.observations[:70], controls=whole.controls[:70])
    write_demonstrations(tmp_path / "half.npz", half)
    with pytest.raises(PlanError, match="no lap closes: the longest stretch"):
        asked(tmp_path / "half.npz", tmp_path / "ring.toml")
    assert not (tmp_path / "ring.toml").exists()


def test_laps_of_two_courses_are_not_surveyed_as_one(tmp_path: Path) -> None:
    whole = a_lap_of_the_oval()
    two = replace(whole, about=replace(whole.about, tracks=("oval", "paddock")))
    write_demonstrations(tmp_path / "two.npz", two)
    with pytest.raises(RecordingError, match=r"two\.npz: drives on oval, paddock"):
        asked(tmp_path / "two.npz", tmp_path / "ring.toml")


def test_the_map_begins_where_the_drive_begins_and_looks_ahead() -> None:
    log, vehicle = sensor_log_of(a_lap_of_the_oval())
    assert vehicle is TT02
    shares: list[float] = []
    found = survey_drive(log, vehicle, shares.append)
    x, y = found.points[0, :2]
    ahead = found.points[1, :2] - found.points[0, :2]
    # The grid lies behind the middle of a straight, 1.2 m wide.
    assert abs(x) < 0.2
    assert abs(y) < 0.6
    assert ahead[0] > 0.99 * np.hypot(*ahead)
    assert found.closing_m < 0.1
    assert (sorted(shares), shares[-1]) == (shares, 1.0)
