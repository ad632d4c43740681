"""Demonstrations: kept in files, read safely, and learned from."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from race_agents.training.demonstrations import (
    Demonstrations,
    pairs_for,
    read_demonstrations,
    write_demonstrations,
)
from race_agents.training.demonstrator import demonstrate
from race_server.cli.main import app
from race_server.errors import RecordingError, ScenarioError
from support.warm_starts import imitate, settings


@pytest.fixture(scope="module")
def shown() -> Demonstrations:
    return demonstrate("raceline", ["oval"], "tt02", laps=1, seed=1, noise=0.1)[0]


def test_demonstrations_come_back_as_they_were(shown: Demonstrations, tmp_path: Path) -> None:
    write_demonstrations(tmp_path / "laps.npz", shown)
    again = read_demonstrations(tmp_path / "laps.npz")
    assert again.about == shown.about
    assert np.array_equal(again.observations, shown.observations)
    assert np.array_equal(again.controls, shown.controls)


def test_a_learner_takes_what_it_sees_out_of_demonstrations(
    shown: Demonstrations, tmp_path: Path
) -> None:
    write_demonstrations(tmp_path / "laps.npz", shown)
    seen, actions = pairs_for(settings(), tmp_path / "laps.npz")
    assert np.array_equal(seen[:, :21], shown.observations[:, 0:201:10])
    assert np.array_equal(actions[:, 1], shown.controls[:, 0])


def test_foreign_and_damaged_files_are_refused_in_one_sentence(
    shown: Demonstrations, tmp_path: Path
) -> None:
    path = tmp_path / "laps.npz"
    write_demonstrations(path, shown)
    with np.load(path) as tables:
        good = dict(tables)
    words = json.loads(str(good["about"]))

    def refused(message: str, **changes: object) -> None:
        with path.open("wb") as file:
            np.savez(file, **{**good, **changes})
        with pytest.raises(RecordingError, match=message):
            read_demonstrations(path)

    refused("version 9, this program reads", about=np.array(json.dumps({**words, "version": 9})))
    refused("parts", about=np.array(json.dumps({**words, "parts": ["sonar"]})))
    refused("driver = 3", about=np.array(json.dumps({**words, "driver": 3})))
    for interval in (0.0, -0.05, 1e-320, float("nan")):
        about = json.dumps({**words, "decision_s": interval})
        refused("decision_s = .* is not valid", about=np.array(about))
    strange = json.dumps({**words, "lidar_field": float("nan")})
    refused("lidar_field = nan is not valid", about=np.array(strange))
    refused("damaged", about=np.array("{"))
    refused("damaged", observations=np.array([{"an": "object"}], object))
    refused("n above zero", controls=good["controls"][:-1])
    refused("no numbers", controls=np.full_like(good["controls"], np.nan))
    write_demonstrations(path, shown)
    packed = bytearray(path.read_bytes())
    packed[200:400] = bytes(200)
    path.write_bytes(packed)
    with pytest.raises(RecordingError, match="damaged"):
        read_demonstrations(path)
    with path.open("wb") as file:
        np.save(file, np.zeros(3))  # one array, and no table of them
    with pytest.raises(RecordingError, match="damaged"):
        read_demonstrations(path)
    path.write_bytes(b"PK\x03\x04 nonsense")
    with pytest.raises(RecordingError, match="damaged"):
        read_demonstrations(path)
    with pytest.raises(RecordingError, match="no such file"):
        read_demonstrations(tmp_path / "none.npz")


def test_controls_are_taken_within_their_limits(shown: Demonstrations, tmp_path: Path) -> None:
    """As the world takes them; and to accept a rescue is not to use an item."""
    controls = shown.controls.copy()
    controls[:4, 0] = 1e30
    controls[:4, 3] = [0.0, 1.0, 2.0, 3.0]
    write_demonstrations(tmp_path / "laps.npz", replace(shown, controls=controls))
    _, actions = pairs_for(settings(), tmp_path / "laps.npz")
    assert actions[:4, 1].tolist() == [1.0] * 4
    assert actions[:4, 2].tolist() == [0.0, 1.0, 0.0, 1.0]


def test_demonstrations_without_a_speed_are_refused(shown: Demonstrations, tmp_path: Path) -> None:
    seen = shown.observations[:, :201].copy()
    blind = replace(shown, about=replace(shown.about, parts=("lidar",)), observations=seen)
    write_demonstrations(tmp_path / "laps.npz", blind)
    with pytest.raises(ScenarioError, match="shows no 'speed', by which a pedal brakes"):
        pairs_for(settings("observation=['lidar']"), tmp_path / "laps.npz")


def test_demonstrations_of_another_vehicle_are_refused(
    shown: Demonstrations, tmp_path: Path
) -> None:
    write_demonstrations(tmp_path / "laps.npz", shown)
    with pytest.raises(ScenarioError, match="vehicle = 'tt02', the training's is 'kart-60'"):
        pairs_for(settings("vehicle=kart-60"), tmp_path / "laps.npz")


def test_a_command_records_laps_from_which_a_network_learns(tmp_path: Path) -> None:
    path = tmp_path / "laps.npz"
    words = ["demonstrate", "raceline", "--track", "oval", "--laps", "1", "--noise", "0.2"]
    done = CliRunner().invoke(app, [*words, "--out", str(path), "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["decisions"] > 50
    wanted = settings(
        "warm_start.teacher=",
        f"warm_start.demonstrations={path}",
        "steps=2048",
        "warm_start.lessons=50",
    )
    _, said = imitate(wanted)
    errors = [float(word.strip(",")) for word in said[-1].split()[-3:]]
    assert errors[1] < 0.1


def test_laps_on_several_tracks_are_counted_together(tmp_path: Path) -> None:
    words = ["demonstrate", "raceline", "--tracks", "oval,oval-report", "--laps", "1"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "laps.npz")])
    assert done.exit_code == 0, done.output
    assert "in 2 laps on oval, oval-report" in done.stderr


@pytest.mark.parametrize("option", ["--noise 0.2", "--laps 9", "--tracks oval", "--seed 2"])
def test_options_of_driving_are_refused_beside_a_recording(option: str, tmp_path: Path) -> None:
    words = ["demonstrate", "--recording", str(tmp_path / "race.mcap"), *option.split()]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == 2 or isinstance(told.exception, ScenarioError)
    assert f"{option}: is of laps driven now" in str(told.exception) + told.output
