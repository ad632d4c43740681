"""Simulated pupils, and what the coach says of them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from race_agents.pupils.coaching_exam import (
    Attempted,
    CoachingExamSpec,
    School,
    cue_ends,
    document_of,
    summary_of,
)
from race_agents.pupils.habit import Habit, Road, line_with, road_of, unsteady
from race_agents.pupils.laps import drive_lap
from race_server.coaching.corners import Corner, corners_of
from race_server.coaching.faults import Fault, FaultKind, faults_of
from race_server.coaching.lap import reference_lap
from race_server.coaching.losses import lap_loss
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import ScenarioError
from race_server.scenario.raceline.attach import reference_line
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.track.load import load_course

TRACK, KART = "hangar-400", "kart-60"


@cache
def place() -> tuple[Road, tuple[Corner, ...]]:
    course, vehicle = load_course(TRACK), vehicle_named(KART)
    line, bounds = reference_line(course, vehicle), bounds_of(vehicle)
    lap = reference_lap(course, line, bounds)
    return road_of(course, line, bounds, lap), corners_of(lap)


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        (FaultKind.EARLY_BRAKES, 6.0),
        (FaultKind.COASTING, 12.0),
        (FaultKind.LATE_TURN_IN, 6.0),
        (FaultKind.SLOW_BEND, 1.2),
        (FaultKind.WIDE_APEX, 1.2),
        (FaultKind.LATE_THROTTLE, 6.0),
        (FaultKind.LIFT, 8.0),
        (FaultKind.SHORT_EXIT, 1.5),
    ],
)
def test_a_fault_on_the_line_of_the_limit_is_named_in_its_corner(
    kind: FaultKind, size: float
) -> None:
    road, corners = place()
    line = line_with(road, Habit(kind, corners[2], size))
    assert line is not None
    lap = reference_lap(road.course, line, road.bounds)
    loss = lap_loss(lap, road.lap, corners, road.bounds)
    first = faults_of(lap, road.lap, loss)[0]
    assert (first.corner.name, first.kind) == ("T3", kind)
    assert first.cost_us == loss.corners[2].total_us
    assert first.cost_us > 0.85 * loss.total_us


def test_the_size_of_early_brakes_is_told_in_metres() -> None:
    road, corners = place()
    for size in (4.0, 8.0):
        line = line_with(road, Habit(FaultKind.EARLY_BRAKES, corners[1], size))
        assert line is not None
        lap = reference_lap(road.course, line, road.bounds)
        (fault,) = faults_of(lap, road.lap, lap_loss(lap, road.lap, corners, road.bounds))
        assert fault.size == pytest.approx(size, abs=0.8)


def test_the_limit_has_no_fault_against_itself() -> None:
    road, corners = place()
    assert not faults_of(road.lap, road.lap, lap_loss(road.lap, road.lap, corners, road.bounds))


def test_where_the_road_has_no_room_there_is_no_such_habit() -> None:
    road, corners = place()
    assert line_with(road, Habit(FaultKind.SHORT_EXIT, corners[0], 1.8)) is None
    assert line_with(road, Habit(FaultKind.WIDE_APEX, corners[0], 9.0)) is None


def test_random_errors_stay_on_the_road_and_differ_from_seed_to_seed() -> None:
    road, _ = place()
    one, other = unsteady(road, 1), unsteady(road, 2)
    assert np.array_equal(one.x, unsteady(road, 1).x)
    assert float(np.abs(one.x - other.x).max()) > 0.05
    assert min(float(one.left.min()), float(one.right.min())) > road.bounds.reach - 0.1


def test_a_driven_fault_is_named_and_all_that_the_lap_is_slower_is_accounted_for() -> None:
    school = School(TRACK, KART)
    road, corners, clean = school.road, school.corners, school.best
    habit = Habit(FaultKind.EARLY_BRAKES, corners[1], 7.0)
    line = line_with(road, habit)
    assert line is not None
    late = drive_lap(road.course, KART, line, 0)
    assert late is not None
    loss = lap_loss(late, clean, corners, road.bounds)
    fault = faults_of(late, clean, loss)[0]
    assert (fault.corner.name, fault.kind) == ("T2", FaultKind.EARLY_BRAKES)
    assert fault.size == pytest.approx(7.0, abs=1.0)
    # The pupil may lose time elsewhere too; all of it is accounted for.
    assert 200_000 < fault.cost_us < 600_000
    spent = loss.line_us + sum(one.total_us for one in loss.corners)
    assert spent == late.time_us - clean.time_us


def tried(kind: str, cost_us: int, named: str, *elsewhere: str) -> Attempted:
    corner = "" if kind in {"clean", "weak motor"} else "T1"
    return Attempted(1, kind, 1.0, corner, cost_us, cost_us + 10_000, named, elsewhere)


def test_an_exam_counts_faults_that_cost_something() -> None:
    laps = [
        tried("coasting", 100_000, "coasting"),
        tried("coasting", 200_000, "early_brakes"),
        tried("coasting", 30_000, ""),
        tried("clean", 0, "", "unknown"),
        tried("weak motor", 300_000, "", "unknown", "lift"),
    ]
    figures = summary_of(laps, corners=5)
    assert (figures["faults"], figures["named"], figures["harmless"]) == (2, 1, 1)
    assert figures["named_share"] == 0.5
    assert figures["cost_near_share"] == 1.0
    assert (figures["clean_corners"], figures["clean_corners_with_a_fault"]) == (5, 0)
    assert (figures["weak_corners_with_a_word"], figures["weak_corners_called_unknown"]) == (2, 1)


def test_clean_corners_are_those_of_the_course_and_pupils_those_that_came_round() -> None:
    # No habit was driven in the other four corners, and the pupils 2 and 3 did not come round.
    laps = [tried("clean", 0, ""), tried("coasting", 100_000, "coasting")]
    document = document_of(CoachingExamSpec(TRACK, KART, range(1, 4)), laps, corners=5)
    assert document["clean_corners"] == 5
    assert (document["seeds"], document["failed_seeds"]) == (1, [2, 3])


def test_a_line_that_is_not_driven_round_is_told_in_one_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_agents.pupils.coaching_exam.drive_lap", lambda *_, **__: None)
    with pytest.raises(ScenarioError, match=r"'hangar-400' .* raceline does not come round"):
        School(TRACK, KART)


def test_a_pupil_hears_one_cue_at_a_time() -> None:
    road, corners = place()
    one = Fault(corners[2], FaultKind.EARLY_BRAKES, 6.0, "m", 100_000)
    # 2 m behind the place of the first: the kart is there before the first cue has been spoken.
    other = replace(one, corner=replace(one.corner, name="next", brake=one.corner.brake + 2.0))
    counts = [
        len(list(cue_ends(road.lap, road.lap, told))) for told in ([one], [other], [one, other])
    ]
    assert counts == [1, 1, 1]
