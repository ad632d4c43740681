"""Reproductions of parking: what is counted, what helps to learn, and how a table shows it."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from race_agents.reproductions import demonstration, run
from race_agents.reproductions.demonstration import demonstrations_of, imitating
from race_agents.reproductions.parking_exam import FAILURES, examine_parking
from race_agents.reproductions.plan import ParkingExam, Reproduction, TrainingScale, Variant
from race_agents.reproductions.registry import reproduction_named
from race_agents.reproductions.report_a import CLONING, GAIL, reward, stages
from race_agents.reproductions.summary import lines_of
from race_agents.reproductions.table import page, texts_of
from race_agents.reproductions.training import run_training, trainings_of
from race_agents.reproductions.watch import reached_at, settled_at
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_server.core.driver import Briefing
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder
from race_server.envs.parking.reward_terms import REWARDS
from race_server.errors import DriverError, ScenarioError

# One slot 5 m ahead, 3 seconds for each way.
TINY = TrainingScale(
    steps=128,
    seeds=1,
    starts=3,
    demonstrated=30,
    changes=(
        "parking.lots=['face-to-face']",
        "parking.limit_s=3.0",
        "worlds=2",
        "network.layers=[8, 8]",
        "algorithm.options={n_steps = 32, batch_size = 64, n_epochs = 1}",
    ),
)


def tiny(*rows: Variant) -> Reproduction:
    """A reproduction of a few seconds."""
    whole = reproduction_named("report-a-scenario-1")
    return replace(whole, rows=rows, quick=TINY, full=TINY)


def face_to_face(*changes: str) -> Settings:
    simple = ("parking.lots=['face-to-face']", "steps=128", "action=report_a")
    return read_settings("report-a", [*simple, *changes])


class Straight:
    """Drives to the slot ahead, or backwards into the wall."""

    preset = "lot"

    def __init__(self, throttle: float) -> None:
        self.throttle = throttle
        self.order: ParkingOrder | None = None

    def reset(self, briefing: Briefing) -> None:
        self.order = None

    def park(self, order: ParkingOrder) -> None:
        self.order = order

    def act(self, _: Observation) -> Control:
        assert self.order is not None
        return Control(0.0, self.throttle, 0.0)


@pytest.fixture
def demonstrator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demonstration, "driver_named", lambda _: Straight(1.0))


# The exam


def test_an_exam_counts_how_each_start_ended() -> None:
    def ahead(seen: Any) -> Any:
        return np.tile(np.float32([1.0, 0.0, -1.0]), (len(seen), 1))

    figures = examine_parking(face_to_face(), ParkingExam(starts=4), ahead)
    assert (figures["starts"], figures["parked"], figures["aligned"]) == (4, 4, 4)
    assert [figures[name] for name in FAILURES] == [0] * 8
    assert (figures["open"], figures["open_parked"], figures["barred"]) == (4, 4, 0)
    # Decisions of 0.1 s: 4.6 m/s² up to 3.6 m/s take 0.8 s and 1.4 m, the other 3.1 m take 0.9 s.
    assert figures["length"] == 17
    hurried = examine_parking(face_to_face("parking.limit_s=1.0"), ParkingExam(starts=4), ahead)
    assert (hurried["parked"], hurried["late"], hurried["time_s"]) == (0, 4, None)


def test_what_is_learned_is_reached_at_90_percent_of_where_it_ends() -> None:
    curve = [(10 * point, min(0.1 * point, 1.0)) for point in range(20)]
    assert settled_at(curve, [float(point) for point in range(20)]) == 9.0
    assert settled_at([(10, 0.0), (20, 0.0)], [1.0, 2.0]) is None
    assert settled_at([], []) is None


def test_a_share_is_reached_at_the_first_point_of_a_curve_that_has_it() -> None:
    curve = [(10, 0.5), (20, 0.8), (30, 0.7), (40, 0.9)]
    assert reached_at(curve, 0.8) == 20.0
    assert reached_at(curve, 0.95) is None


# The table


def counted(seed: int, parked: int, aligned: int) -> dict[str, Any]:
    plan = reproduction_named("report-a-scenario-1")
    figures: dict[str, Any] = dict.fromkeys((column.key for column in plan.columns), 0)
    figures |= {"starts": 100, "parked": parked, "aligned": aligned, "left": 100 - parked}
    curve = [[10, 0.5], [20, 1.0]]
    row = "configuration 2, crooked costs 0.5"
    return {"row": row, "seed": seed, "steps": 20, "figures": figures, "curve": curve}


def test_counts_of_all_runs_make_a_percentage_with_its_interval() -> None:
    plan = reproduction_named("report-a-scenario-1")
    lines = lines_of(plan, [counted(1, 100, 90), counted(2, 80, 72)])
    texts = texts_of(plan, lines[0], None, 2)
    # Wilson's interval of 180 of 200.
    assert texts[5] == "90.0 ± 14.1 [85.1, 93.4]"
    assert texts[7].startswith("90.0 ± 0.0 [")  # 162 aligned of 180 parked
    assert "10.0 ± 14.1" in texts  # left: counts, but no interval
    text = page(plan, plan.full, lines, {}, quick=False)
    assert "the interval of 95 % (Wilson) over all starts of all runs" in text
    assert "each then parks from 1000 starts that no training had" in text


def test_further_curves_are_a_mean_and_a_range_of_the_runs() -> None:
    plan = reproduction_named("report-a-scenario-1")
    one, other = counted(1, 100, 90), counted(2, 80, 72)
    one["curves"] = {"length": [[10, 50.0], [20, 40.0], [30, 30.0]]}
    other["curves"] = {"length": [[20, 60.0], [30, 10.0]]}
    (line,) = lines_of(plan, [one, other])
    assert line.bands == {"length": ((20.0, 50.0, 40.0, 60.0), (30.0, 20.0, 10.0, 30.0))}
    (older,) = lines_of(plan, [one, counted(2, 80, 72)])
    assert older.bands == {}


def test_a_share_of_nothing_is_no_figure() -> None:
    plan = reproduction_named("report-a-scenario-1")
    (line,) = lines_of(plan, [counted(1, 0, 0)])
    parked, _, of_parked = plan.columns[:3]
    assert (line.number(parked), line.number(of_parked)) == (0.0, None)
    assert line.bounds(of_parked) is None
    below, above = line.margins(parked)
    assert below == 0.0
    assert above == pytest.approx(3.7, abs=0.05)  # Wilson: up to 3.7 % of 100


# What helps to learn


def test_a_table_of_rewards_takes_other_weights() -> None:
    changed = read_settings("report-a", ["steps=1", reward("report_a_2", misparked=-0.1)])
    assert changed.reward == {**REWARDS["report_a_2"], "misparked": -0.1}


def test_stages_move_away_from_the_slot_and_end_where_the_lot_begins() -> None:
    near, far, whole = read_settings(
        "report-a", [stages(((2.0, 6.0), (2.0, 12.0)), 0.5)]
    ).curriculum
    assert (near.after, near.distance, near.until_success) == (0.0, (2.0, 6.0), 0.8)
    assert (far.after, far.distance) == (0.25, (2.0, 12.0))
    assert (whole.after, whole.distance) == (0.5, None)


@pytest.mark.usefixtures("demonstrator")
def test_a_demonstration_holds_decisions_of_ways_that_park() -> None:
    shown = demonstrations_of(face_to_face(), 30)
    assert shown.controls.shape == (30, 4)
    assert shown.controls[:, 1].tolist() == [1.0] * 30
    assert (shown.about.tracks, shown.about.decision_s) == (("face-to-face",), 0.1)
    with imitating(face_to_face(), ("gail",), 30) as settings:
        assert Path(settings.gail.demonstrations).is_file()
        assert not settings.cloning.demonstrations
    assert not Path(settings.gail.demonstrations).exists()


def test_who_never_parks_demonstrates_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demonstration, "driver_named", lambda _: Straight(-1.0))
    with pytest.raises(ScenarioError, match="did not park 20 times running"):
        demonstrations_of(face_to_face(), 30)


def test_a_driver_that_takes_no_order_demonstrates_nothing() -> None:
    with pytest.raises(DriverError, match="cannot park: it takes no order"):
        demonstrations_of(face_to_face(), 30, "idm")


@pytest.mark.usefixtures("demonstrator")
@pytest.mark.slow
def test_a_training_with_all_aids_is_run_examined_and_drawn(tmp_path: Path) -> None:
    changes = (*GAIL, *CLONING, "action=report_a", "curiosity.bonus=0.02", stages(((2, 6),), 0.5))
    row = Variant("aided", changes, theirs=("1", "2", "3", "4"), imitates=("gail", "cloning"))
    done = run.reproduce("it", tiny(row), tmp_path, quick=True)
    figures = done.lines[0].figures[0]
    assert figures["starts"] == 3
    assert sum(figures[name] or 0 for name in ("parked", *FAILURES)) == 3
    document = json.loads((tmp_path / run.FIGURES).read_text())
    assert document["rows"][0]["imitates"] == ["gail", "cloning"]
    assert set(document["rows"][0]["bounds"]) >= {"parked of starts", "aligned of parked"}
    assert (tmp_path / run.PLOT).stat().st_size > 5000


def test_a_cell_is_another_one_with_other_demonstrations() -> None:
    row = Variant("aided", imitates=("gail",))
    (training,) = trainings_of(tiny(row), TINY)
    (longer,) = trainings_of(tiny(row), replace(TINY, demonstrated=40))
    assert (training.demonstrated, longer.demonstrated) == (30, 40)
    assert training.key != longer.key
    (alone,) = trainings_of(tiny(Variant("alone")), TINY)
    assert (alone.demonstrated, alone.row.imitates) == (0, ())


def test_a_row_without_aids_learns_by_its_reward_alone() -> None:
    (training,) = trainings_of(tiny(Variant("alone")), TINY)
    found = run_training(training)
    assert found["steps"] == 128
    assert found["figures"]["starts"] == 3
    assert found["figures"]["learning_cpu_s"] > 0.0
