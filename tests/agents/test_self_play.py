"""Self-play: drivers of seats, rated snapshots, and a policy that advises a driver."""

import json
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest

from race_agents.drivers.learned import Learned
from race_agents.policies.registry import policy_path
from race_agents.policies.session import Policy
from race_agents.training import curve, folder
from race_agents.training.callback import CURVE
from race_agents.training.rivals import Rivals, short_name
from race_agents.training.run import TrainingResult
from race_agents.training.self_play import RATINGS, SelfPlay, _read, _write
from race_agents.training.settings import SelfPlaySettings
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import training_task
from race_server.competition.time_trial.run import numbers_of
from race_server.core.driver import driver_named
from race_server.core.observation import Observation, layout_of
from race_server.core.rules.items import items
from race_server.core.vehicle_presets import TT02
from race_server.core.vehicles import vehicle_record
from race_server.envs.advice import Adviser
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.load import load_course
from support.briefings import briefing
from support.trainings import SMALL, Train, side_by_side, untrained

QUICK = (
    *SMALL,
    "steps=3000",
    "worlds=4",
    "gap={}",
    "race={karts = 4, learners = 2, opponents = ['idm']}",
    "self_play={seats = ['learner', 'learner', 'pool', 'idm'], anchors = ['raceline', 'idm'], "
    "stretch = 1000, snapshot = 1000, races = 2, laps = 1}",
    "evaluation.seeds=1",
    "evaluation.times=1",
    "evaluation.seconds=2.0",
)


@pytest.fixture(scope="module")
def outcome(trained: Train) -> TrainingResult:
    """A run of three thousand decisions in three stretches."""
    return trained("race", QUICK)


BRIEFING = briefing("line", items=tuple(item.name for item in items()))

# The pool


def test_seats_are_mapped_to_drivers_and_the_pool_is_drawn(tmp_path: Path) -> None:
    seats = ("learner", "pool", "raceline", "pool")
    rivals = Rivals(SelfPlaySettings(seats=seats, anchors=("avoider", "idm")), tmp_path)
    drawn = [rivals.seated(Random(seed)) for seed in range(20)]
    assert {row[1] for row in drawn} == {"raceline"}
    assert {name for row in drawn for name in (row[0], row[2])} == {"avoider", "idm"}


def test_a_full_pool_keeps_the_first_snapshot_and_the_newest(tmp_path: Path) -> None:
    rivals = Rivals(SelfPlaySettings(snapshots=2), tmp_path)
    for decisions in (100, 200, 300):
        path = rivals.place_for(decisions)
        path.touch()
        rivals.add(path)
    assert [path.stem[-3:] for path in rivals.snapshots] == ["100", "300"]
    assert sorted(rivals.folder.glob("*.onnx")) == rivals.snapshots
    assert Rivals(SelfPlaySettings(snapshots=2), tmp_path).snapshots == rivals.snapshots


def test_a_snapshot_that_is_taken_again_is_in_the_pool_once(tmp_path: Path) -> None:
    rivals = Rivals(SelfPlaySettings(snapshots=2), tmp_path)
    for decisions in (100, 200, 200, 300):
        path = rivals.place_for(decisions)
        path.touch()
        rivals.add(path)
        assert all(one.is_file() for one in rivals.snapshots)
    assert [path.stem[-3:] for path in rivals.snapshots] == ["100", "300"]


def test_snapshots_are_in_the_order_of_their_decisions(tmp_path: Path) -> None:
    """As text 1000000000 comes before 999600000."""
    rivals = Rivals(SelfPlaySettings(snapshots=4), tmp_path)
    for decisions in (400_000, 999_600_000, 1_000_000_000):
        path = rivals.place_for(decisions)
        path.touch()
        rivals.add(path)
    assert Rivals(SelfPlaySettings(snapshots=4), tmp_path).snapshots == rivals.snapshots


@pytest.mark.parametrize("text", ['{"races": [[["idm", 1', "[]", '{"races": [["idm"]]}', "\xff"])
def test_ratings_that_are_damaged_are_named(text: str, tmp_path: Path) -> None:
    (tmp_path / RATINGS).write_bytes(text.encode("latin-1"))
    with pytest.raises(ScenarioError, match=r"ratings\.json: damaged: .*; remove it, and rating"):
        _read(tmp_path / RATINGS)


def test_ratings_are_whole_or_those_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    races = [[("idm", 1), ("raceline", 2)]]
    _write(tmp_path / RATINGS, races, [])

    def full(*_: object) -> None:
        raise OSError

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError):  # noqa: PT011  # of `full`
        _write(tmp_path / RATINGS, [*races, *races], [])
    assert _read(tmp_path / RATINGS)[0] == races
    assert list(tmp_path.iterdir()) == [tmp_path / RATINGS]


def test_a_snapshot_that_is_taken_again_is_rated_by_its_last_races(
    outcome: TrainingResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = folder.settings_in(outcome.folder)
    _, world, learner = untrained(settings)
    played = SelfPlay(settings, tmp_path, world, 0)
    raced = iter([[[("learner-1000", 1), ("idm", 2)]], [[("idm", 1), ("learner-1000", 2)]]])
    monkeypatch.setattr(SelfPlay, "_raced", lambda *_: next(raced))
    monkeypatch.setattr("race_agents.training.self_play.short_name", lambda _: "learner-1000")
    for _ in range(2):
        played.keep(learner, 1000)
    assert played.races == [[("idm", 1), ("learner-1000", 2)]]
    world.close()


def test_seats_that_do_not_fit_the_race_are_named() -> None:
    with pytest.raises(ScenarioError, match=r"seats names 2 karts, 1 of them learners; race.karts"):
        read_settings("race", ["self_play.seats=['learner', 'idm']"])


# A run


def test_a_run_leaves_snapshots_and_ratings(outcome: TrainingResult) -> None:
    words = json.loads((outcome.folder / RATINGS).read_text())
    names = {row["driver"] for row in words["ratings"]}
    snapshots = {path.stem for path in outcome.folder.glob("snapshots/*.onnx")}
    assert {"raceline", "idm"} | snapshots == names
    assert len(snapshots) >= 2
    assert all(sorted(rank for _, rank in race) == [1, 2, 3, 4] for race in words["races"])


def test_the_curve_tells_the_rating_of_the_newest_snapshot(outcome: TrainingResult) -> None:
    rows = [row for row in curve.read(outcome.folder / CURVE) if "rating" in row]
    assert rows
    assert all(row["rating_sigma"] > 0.0 for row in rows)


def test_tables_name_a_snapshot_by_its_file() -> None:
    assert short_name("learned:/tmp/a/learner-000001000.onnx") == "learner-000001000"
    assert short_name("learned:race") == "learned:race"


# A policy that advises


def oval(karts: int) -> Scenario:
    return Scenario(load_course("oval"), karts=karts, rules=LEARNING_RULES)


def test_without_advice_a_kart_drives_as_the_driver_that_is_advised() -> None:
    others = {"learners": 1, "opponents": ("idm",)}
    advised = Batch(task_on((oval(2),), action="residual", base="raceline", **others), seed=4)
    driven = Batch(task_on((oval(2),), action="control", observation="line", **others), seed=4)
    driver = driver_named("raceline")
    driver.reset(BRIEFING)
    for step in range(80):
        seen = Observation(3 * step, driven.layout, driven.observations[0, 0].copy())
        driven.step(numbers_of(driver.act(seen)))
        advised.step(np.zeros((1, 1, 6)))
    assert advised.world.bodies["x"][0] == pytest.approx(driven.world.bodies["x"][0], abs=1e-5)
    assert advised.world.racers["distance"][0, 0] > 1.0


def test_advice_shifts_the_lane_to_its_side() -> None:
    task = task_on((oval(1),), action="residual", base="raceline", observation=("line_offset",))
    left, right = Batch(task, seed=4), Batch(task, seed=4)
    for _ in range(80):
        left.step([[[0.9, 0.0, 0.0, 0.0, 0.0, 0.0]]])
        right.step([[[-0.9, 0.0, 0.0, 0.0, 0.0, 0.0]]])
    assert left.observations[0, 0, 0] > right.observations[0, 0, 0] + 0.1


@pytest.mark.parametrize("parts", [("karts_x", "karts_y"), ("karts_along", "karts_across")])
def test_who_sees_others_leaves_lane_and_speed_to_the_driver_while_none_is_within_4_m(
    parts: tuple[str, str],
) -> None:
    """NEAR_LENGTHS = 10 of a car that is 0.4 m long; three of four karts are not there."""
    layout = layout_of(parts, 0)
    vehicle = vehicle_record(replace(TT02, length=0.4))[0]
    adviser = Adviser(layout, parts, vehicle)
    actions = np.array([[1.0, 0.5, -1.0, 0.2, 0.8, 1.0]] * 2, np.float32)
    for away, told in (((2.4, -3.1), True), ((2.4, -3.3), False), ((1e3, 1e3), False)):
        seen = np.full((2, layout.size), 1e3)
        for part, place in zip(parts, away, strict=True):
            seen[:, layout.slices[part].start] = place
        lane, faster = (TT02.width, 0.06) if told else (0.0, 0.0)
        wanted = [lane, faster, -1.0, 0.1, 0.8, 1.0]
        assert adviser.advice(actions, seen) == pytest.approx(np.array([wanted, wanted]))


def test_who_sees_no_others_is_always_heard() -> None:
    layout = layout_of(("line_offset", "karts_x", "karts_y"), 0)
    adviser = Adviser(layout, ("line_offset",), vehicle_record(TT02)[0])
    action = np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.0], np.float32)
    told = adviser.advice(action, np.full(layout.size, 1e3))
    assert told[:2] == pytest.approx([TT02.width, 0.06])


def test_advice_to_follow_closely_brakes_less_behind_another_kart() -> None:
    speeds = []
    for close in (0.0, 0.8):
        others = {"learners": 1, "opponents": ("pure_pursuit",)}
        batch = Batch(task_on((oval(2),), action="residual", base="raceline", **others), seed=4)
        (behind_body, ahead_body), (behind_racer, ahead_racer) = (
            batch.world.bodies[0],
            batch.world.racers[0],
        )
        behind_body.x = ahead_body.x - 2.0 * np.cos(ahead_body.heading)
        behind_body.y = ahead_body.y - 2.0 * np.sin(ahead_body.heading)
        behind_body.heading, behind_racer.line_index = ahead_body.heading, ahead_racer.line_index
        behind_body.speed = 2.0
        for _ in range(3):
            batch.step([[[0.0, 0.0, 0.0, 0.0, close, 0.0]]])
        speeds.append(float(behind_body.speed))
    assert speeds[1] > speeds[0] + 0.1


def test_a_boost_carries_a_kart_beyond_the_line_only_if_it_is_told_to_dash() -> None:
    speeds = []
    for dash in (0.0, 1.0):
        scenario = replace(oval(1), rules=replace(LEARNING_RULES, items=False))
        batch = Batch(task_on((scenario,), action="residual", base="raceline"), seed=4)
        batch.step([[[0.0] * 6]])
        effect = batch.world.players["effects"][0, 0, 0]
        effect["source"], effect["until_tick"] = 1, 10_000
        effect["speed_scale"], effect["thrust_scale"], effect["grip_scale"] = 1.25, 1.6, 1.0
        fastest = 0.0
        for _ in range(160):
            batch.step([[[0.0, 0.0, 0.0, dash, 0.0, 0.0]]])
            fastest = max(fastest, float(batch.world.bodies["speed"][0, 0]))
        assert batch.world.racers["wall_contacts"][0, 0] == 0
        speeds.append(fastest)
    assert speeds[1] > 1.05 * speeds[0]


def test_advice_to_fetch_a_box_drives_over_one() -> None:
    course = load_course("oval")
    on_the_right = replace(course, spots=np.array([[2.65, -1.8]]))  # 0.3 m, of 0.6 m to the border
    rules = replace(LEARNING_RULES, catch_up=False)
    taken = []
    for fetch in (0.0, 1.0):
        scenario = Scenario(on_the_right, karts=1, rules=rules)
        batch = Batch(task_on((scenario,), action="residual", base="raceline"), seed=4)
        for _ in range(160):
            batch.step([[[0.9, 0.0, -1.0, 0.0, 0.0, fetch]]])  # to the left of the line
        taken.append(bool(batch.world.players["held"][0, 0] > 0))
    assert taken == [False, True]


def test_what_a_race_adds_up_to_is_the_place_at_its_end() -> None:
    scenario = replace(oval(4), rules=replace(LEARNING_RULES, laps=1))
    opponents = ("pure_pursuit", "idm", "avoider")
    task = task_on(
        (scenario,),
        opponents=opponents,
        learners=1,
        action="residual",
        base="raceline",
        reward={"lead": 1.0},
        random_grid=True,
    )
    batch = Batch(task, worlds=6, seed=4, after=STAY)
    ranked = batch.world.racers["ranked"].copy()
    gaps = ranked[:, :1] - ranked[:, 1:]
    before = (gaps / (abs(gaps) + 10.0 * TT02.length)).sum(axis=1)
    gained = np.zeros(6)
    while not batch.world.races["over"].all():
        batch.step(np.zeros((6, 1, 6)))
        gained += batch.rewards[:, 0]
    # Of three rivals: those behind less those ahead.
    at_the_end = 5 - 2 * batch.world.racers["rank"][:, 0]
    assert before + gained == pytest.approx(at_the_end, abs=1e-3)


def test_only_a_driver_that_takes_advice_can_be_advised() -> None:
    with pytest.raises(ScenarioError, match="'avoider' takes no advice"):
        Batch(task_on((oval(1),), action="residual", base="avoider"))
    with pytest.raises(ScenarioError, match="needs a driver to advise"):
        Batch(task_on((oval(1),), action="residual"))


def test_a_policy_that_advises_does_live_what_it_did_in_training(outcome: TrainingResult) -> None:
    path = outcome.folder / "policy.onnx"
    policy, driver = Policy(path), Learned(str(path))
    assert driver.preset == "rivals"
    task = training_task(read_settings("race", QUICK))
    trained = Batch(task_on(task.scenarios, **_shared(task, task.observation)), seed=3)
    wide = {**_shared(task, "rivals"), "action": "control", "base": ""}
    raced = Batch(task_on(task.scenarios, **wide), seed=3)
    driver.reset(BRIEFING)
    places = list(side_by_side(trained, raced, policy, driver, 80))
    assert len(places) == 80
    for there, here in places:
        assert here == pytest.approx(there, abs=1e-5)
    assert trained.world.bodies[0, 0].speed > 0.5


def _shared(task: Task, observation: object) -> dict[str, object]:
    return {
        "learners": 1,
        "opponents": ("idm",),
        "observation": observation,
        "action": task.action,
        "base": task.base,
    }


# The bundled policy


def test_the_shipped_policy_comes_before_the_driver_that_it_advises() -> None:
    policy = Policy(policy_path("race"))
    assert policy.metadata.base == "raceline"
    assert "covapsy-test-2023" not in policy.metadata.tracks
    opponents = ("raceline", "idm", "follow_gap", "pure_pursuit")
    rules = Rules(laps=2, countdown_s=0.2)
    task = task_on(
        (Scenario(load_course("covapsy-train-2023"), karts=5, rules=rules),),
        opponents=opponents,
        learners=1,
        observation=policy.metadata.parts,
        action="residual",
        base="raceline",
        random_grid=True,
    )
    batch = Batch(task, worlds=48, seed=7, after=STAY)
    for _ in range(900):
        batch.step(policy.decide(batch.observations[:, 0]))
    places = batch.world.racers["rank"].mean(axis=0)
    assert places[0] < places[1:].min() - 0.4
