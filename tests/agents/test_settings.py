"""Settings of a training: read, checked, and what they make of courses, time and views."""

from pathlib import Path

import numpy as np
import pytest

from race_agents.training import folder
from race_agents.training.budget import Budget
from race_agents.training.run import train
from race_agents.training.settings_toml import as_toml, preset_names, read_settings
from race_agents.training.tasks import training_task
from race_agents.training.view import ObservationView
from race_server.core import codes
from race_server.envs.batch import Batch
from race_server.errors import ScenarioError
from race_server.scenario.track.sets import course_named, names_of, track_sets
from support.trainings import QUICK, untrained


@pytest.mark.parametrize("name", ["time-trial", "time-trial-ppo", "race", "full", "report-b"])
def test_every_preset_can_be_read_and_written_without_loss(name: str, tmp_path: Path) -> None:
    assert name in preset_names()
    settings = read_settings(name)
    path = tmp_path / "again.toml"
    path.write_text(as_toml(settings))
    assert read_settings(str(path)) == settings


@pytest.mark.parametrize("title", ["Kart 🏎", "steps of 2°", 'a "b" \\ud83c', "\x7f\t\n"])
def test_every_title_is_read_again(title: str, tmp_path: Path) -> None:
    settings = read_settings("time-trial-ppo").model_copy(update={"title": title})
    folder.begin(tmp_path, settings)
    assert folder.settings_in(tmp_path) == settings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            "algorithm.name=ppoo",
            "algorithm.name = 'ppoo': input should be 'ppo', 'ppo-sb3', 'mappo', 'poca'",
        ),
        ("worlds=0", "worlds = 0: input should be greater than or equal to 1"),
        ("wolds=3", "wolds = 3: no such key; known here are action, algorithm"),
        (
            "curriculum=[{after = 0, track = 'oval'}]",
            "curriculum.0.track = 'oval': no such key; known",
        ),
        ("observation.lidar=3", "observation = .* is no table here; give it whole"),
        ("network.layer=[3]", "network.layer = .* known here are activation, first_action"),
        ("steps=10", "give one of the two"),
        ("algorithm.name=dqn", "dqn needs discrete actions"),
        ("gap.mass=[1.0]", "gap.mass"),
        ("race.learners=3", "race.learners = 3 with race.karts = 1: give at least as many karts"),
        (
            "network.layers=[100000]",
            "network.layers.0 = 100000: input should be less than or equal to 8192",
        ),
        ("network.products=float16", "products = 'float16': input should be 'bfloat16'"),
        ("network.layers=[0]", "network.layers.0 = 0: input should be greater than 0"),
        ("seed=5000000000", "seed = 5000000000: input should be less than 2147483648"),
        ("algorithm.options.gamma=x", "algorithm.options.gamma = 'x': give a number from 0 to 1"),
        ("algorithm.options.gamma=nan", "gamma = nan: give a number from 0 to 1"),
        ("algorithm.options.n_epochs=0", "n_epochs = 0: give a whole number from 1 on"),
        ("algorithm.options.batch_size=1.5", "batch_size = 1.5: give a whole number"),
        ("algorithm.options.use_sde=3", "use_sde = 3: give true or false"),
        ("algorithm.options.train_freq=[0, 'step']", "train_freq = .* give a whole number"),
        ("goal.parked=0.9", "with parking.lots = .*, goal.parked: choose best_lap_s, crash_rate"),
        ("base=raceline", "base = 'raceline' with action = 'continuous': only residual"),
        ("scan_limit=-1", "scan_limit = -1: input should be greater than 0"),
        ("evaluation.seconds=0.01", "evaluation.seconds = 0.01: no decision is made in them"),
        ("episode.steps=5000000000", "episode.steps = 5000000000: input should be less than"),
    ],
)
def test_a_wrong_setting_is_named_with_its_value(change: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        read_settings("time-trial-ppo", [change])


def test_a_limit_by_the_scan_is_for_policies_that_race_by_a_lidar() -> None:
    changes = ["scan_limit=1.1", "observation=['speed', 'steering']"]
    with pytest.raises(ScenarioError, match=r"scan_limit = 1.1: it is for policies that race"):
        read_settings("time-trial-ppo", changes)


@pytest.mark.parametrize("change", ["algorithm={name = 'sac'}", "network.layers=[64]"])
def test_halves_are_for_networks_of_ppo_with_several_layers(change: str) -> None:
    assert read_settings("time-trial-ppo", ["network.products=bfloat16"]).network.products
    with pytest.raises(ScenarioError, match=r"network.products = 'bfloat16' .*; leave it out"):
        read_settings("time-trial-ppo", ["network.products=bfloat16", change])


def test_policies_that_park_one_body_may_evade() -> None:
    assert read_settings("parking-2").evades
    with pytest.raises(ScenarioError, match="evades = true: it is for policies that park"):
        read_settings("time-trial-ppo", ["evades=true"])
    lorry = read_settings("park-lorry", ["evades=true"])
    with pytest.raises(ScenarioError, match="evades = true with vehicle = 'lorry-16m5'"):
        training_task(lorry)


def test_a_goal_of_races_is_none_in_a_lot() -> None:
    """It would count as reached at the first evaluation, and end the training."""
    with pytest.raises(ScenarioError, match=r"goal.speed: choose aligned, hits, parked"):
        read_settings("parking-1", ["goal.speed=3.0"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("race.rules.lap=3", "race.rules.lap = 3: no such rule"),
        ("race.rules.laps=many", "race.rules.laps = 'many': give a int"),
        ("race.fields=[2]", "race.fields: 2 karts, with race.karts = 1 .*; choose 1 to 1"),
        (
            "race={karts = 4, learners = 2, opponents = ['idm'], fields = [4, 1]}",
            "race.fields: 1 karts, .* race.learners = 2; choose 2 to 4",
        ),
        ("tracks.set=moon", "track set 'moon' is unknown; choose one of train"),
    ],
)
def test_a_task_that_makes_no_race_is_refused(change: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        training_task(read_settings("time-trial-ppo", [change]))


def test_races_are_drawn_with_so_many_karts() -> None:
    changes = ("race.karts=4", "race.opponents=['idm']", "race.fields=[4, 1]")
    wanted = read_settings("time-trial-ppo", [*QUICK, *changes])
    batch = Batch(training_task(wanted), worlds=40, seed=1)
    racing = (batch.world.bodies["status"] == codes.RACING).sum(axis=1)
    assert set(racing.tolist()) == {1, 4}
    assert 10 < (racing == 1).sum() < 30


def test_half_of_the_races_have_no_items() -> None:
    changes = ("race.rules.items=true", "race.half_without_items=true")
    wanted = read_settings("time-trial-ppo", [*QUICK, *changes])
    with_items = [one.rules.items for one in training_task(wanted).scenarios]
    assert with_items.count(True) == with_items.count(False) > 0


def test_each_vehicle_learns_on_every_course() -> None:
    changes = ["tracks.set=''", "tracks.names=['oval','covapsy-base']", "vehicle=tt02"]
    settings = read_settings("time-trial-kart", [*changes, "more_vehicles=['tt02-drift']"])
    found = [(one.course.name, one.vehicle_of(0).name) for one in training_task(settings).scenarios]
    assert found == [
        *(("oval", "tt02"), ("oval", "tt02-drift")),
        *(("covapsy-base", "tt02"), ("covapsy-base", "tt02-drift")),
    ]


def test_a_set_for_karts_names_courses_of_their_scale() -> None:
    names = names_of((), "validation-kart")
    assert names[0] == "generated:spline:8000:kart"
    assert len(names) == 6
    assert min(course_named(name).length for name in names) > 150.0


def test_an_unknown_option_of_the_algorithm_is_named(tmp_path: Path) -> None:
    settings = read_settings("time-trial-ppo", [*QUICK, "algorithm.options.n_step=3"])
    with pytest.raises(ScenarioError, match=r"algorithm.options.n_step = 3: ppo has no such"):
        train(settings, tmp_path)


def test_episodes_of_several_karts_are_no_measure_of_lessons() -> None:
    changes = (*QUICK, "algorithm={name = 'sac', options = {train_freq = [1, 'episode']}}")
    settings = read_settings("time-trial-ppo", changes)
    with pytest.raises(ScenarioError, match=r"\[1, 'episode'\]: 8 karts learn at once, whose epis"):
        untrained(settings)
    _, world, _ = untrained(read_settings("time-trial-ppo", [*changes, "worlds=1"]))
    world.close()


def test_no_course_to_be_tried_out_on_is_learned_on() -> None:
    sets = {name: set(names_of((), name)) for name in track_sets()}
    assert not sets["unseen"] & sets["train"]
    assert not sets["validation-wide"] & (sets["train"] | sets["unseen"])
    assert sets["validation"] <= sets["validation-wide"]
    assert len(sets["train"]) >= 12
    for preset in preset_names():
        settings = read_settings(preset)
        assert not set(names_of(settings.tracks.names, settings.tracks.set)) & set(
            names_of(settings.evaluation.final.names, settings.evaluation.final.set)
        )


def test_a_reversed_course_is_found_by_its_name() -> None:
    assert course_named("oval-reversed").name == "oval-reversed"


def test_the_share_of_a_training_goes_by_what_it_is_measured_in() -> None:
    assert Budget(None, 1000, done=250).share == 0.25
    assert Budget(2.0, None, spent_s=60.0).share == pytest.approx(0.5)
    assert Budget(None, 1000, done=750).share_since(0.5) == 0.5
    assert Budget(None, 1000, done=250).share_since(0.5) == 0.0


def test_a_view_shows_logarithms_and_fills_in_what_did_not_come_back() -> None:
    change = ["observation=['lidar', 'speed']", "lidar={rays = 4, logarithms = true}"]
    view = ObservationView.of(read_settings("time-trial-ppo", change))
    seen = np.array([[1.0, 0.0, 2.0, 4.0, 0.0], [0.0, 0.0, 4.0, 9.0, -1.0]], np.float32)
    # Nothing between 1 m and 2 m counts as 2 m, nothing beside nothing as the reach of 8 m.
    wanted = [[1.0, 2.0, 2.0, 4.0], [8.0, 4.0, 4.0, 8.0]]
    assert np.exp(view(seen)[:, :4]) == pytest.approx(np.array(wanted))
    assert view(seen)[:, 4].tolist() == [0.0, -1.0]
    assert np.array_equal(view(seen[1]), view(seen)[1])


def test_a_view_without_logarithms_only_cuts() -> None:
    view = ObservationView.of(read_settings("time-trial-ppo", ["horizon=3.0"]))
    assert view(np.array([0.0, 5.0, -4.0], np.float32)).tolist() == [0.0, 3.0, -3.0]
