"""Without highway-env: what needs it says what to install, and all else works."""

import sys

import gymnasium
import pytest
from typer.testing import CliRunner

import race_server.envs  # noqa: F401  # registers the ids
from race_server.cli.main import app
from race_server.core.driver import driver_named
from race_server.envs.batch import Batch
from race_server.envs.presets import race_task
from race_server.errors import RaceError
from race_server.scenario.highway import has_highway
from race_server.scenario.track import highway_roads
from race_server.scenario.track.load import load_course
from race_server.second.simulator import check_simulator
from race_server.tools.bench.env import _on_their_road

INSTALL = r"race-server\[bench\]"


@pytest.fixture(autouse=True)
def hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every import of it fail."""
    monkeypatch.setitem(sys.modules, "highway_env", None)
    highway_roads.highway_file.cache_clear()
    assert not has_highway()


@pytest.mark.parametrize(
    "words",
    [
        ["transfer", "raceline"],
        ["transfer", "raceline", "--tracks", "oval"],
        ["transfer", "raceline", "--to", "highway-env-itself", "--traffic", "1"],
        ["track", "check", "highway:racetrack-v0"],
    ],
)
def test_commands_that_need_it_say_what_to_install(words: list[str]) -> None:
    outcome = CliRunner().invoke(app, words)
    assert outcome.exit_code != 0
    assert "race-server[bench]" in "".join(f"{outcome.output} {outcome.exception}".split("\n"))


def test_a_simulator_a_driver_and_a_road_of_it_say_what_to_install() -> None:
    with pytest.raises(RaceError, match=INSTALL):
        Batch(race_task("oval", karts=1, simulator="highway-env"))
    with pytest.raises(RaceError, match=INSTALL):
        check_simulator("highway-env")
    with pytest.raises(RaceError, match=INSTALL):
        driver_named("highway_idm")
    with pytest.raises(RaceError, match=INSTALL):
        load_course("highway:racetrack-v0")


def test_commands_that_list_work_without_it() -> None:
    for words in (["drivers"], ["track", "list"], ["lot", "list"], ["reproduce"]):
        assert CliRunner().invoke(app, words).exit_code == 0


def test_the_car_park_is_ours_alone() -> None:
    env = gymnasium.make("Kart/ParkCompatible-v0", disable_env_checker=True)
    env.reset(seed=1)
    assert env.step([1.0, 0.0])[4]["speed"] > 0.9


def test_a_benchmark_leaves_its_figures_out() -> None:
    assert _on_their_road(0.1) == {"vector_grid": None, "gym_grid": None}
