"""Mapping a course by lidar: where a scan fits, how a lap closes, how wide the course is."""

import math
from dataclasses import replace
from functools import cache
from itertools import count
from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest

from race_agents.planning.charted_course import (
    Chart,
    borders_along,
    chart_lap,
    course_between,
    line_on,
)
from race_agents.planning.charting import Charting
from race_agents.planning.gap_way import MOUNT
from race_agents.planning.lap_survey import LapSurvey, dead_reckoning, path_of, spread_error
from race_agents.planning.line_view import LineView
from race_agents.planning.seen_through import walls_unseen
from race_agents.planning.wall_map import (
    Pose,
    Scan,
    WallMap,
    compose,
    inverse,
    placed,
    read_scan,
)
from race_agents.planning.wayfinder import Wayfinder
from race_server.core.clock import ticks_of
from race_server.core.observation import Observation, layout_of
from race_server.core.state import Floats
from race_server.core.vehicle_presets import vehicle_named
from race_server.scenario.raceline import attach
from race_server.scenario.raceline.attach import stand_in
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.track.polyline import area_of, crossings, segments_of
from race_server.scenario.track.raycast import first_met
from support.briefings import briefing
from support.courses import ring

CELL, LENGTH, FIELD, REACH = 0.1, 0.45, math.radians(200.0), 8.0
ANGLES = np.linspace(-0.5 * FIELD, 0.5 * FIELD, 201)


def rectangle(x: float, y: float) -> Floats:
    return segments_of(np.array([(x, y), (-x, y), (-x, -y), (x, -y)]))


# A room of 4 m by 3 m with a post in it.
ROOM = np.concatenate([rectangle(2.0, 1.5), rectangle(0.2, 0.2) + np.array([1.0, 0.6] * 2)])


def ranges_in(walls: Floats, pose: Pose, seed: int) -> Floats:
    """Return the ranges of a lidar with 1 cm of noise."""
    x, y, heading = pose
    ranges, _ = first_met(walls, x, y, ANGLES + heading, REACH)
    return np.clip(ranges + np.random.default_rng(seed).normal(0.0, 0.01, len(ranges)), 0.0, REACH)


def scan_in(walls: Floats, pose: Pose, seed: int) -> Scan:
    return read_scan(ranges_in(walls, pose, seed), FIELD, REACH, 0.0, CELL)


def map_from(walls: Floats, poses: list[Pose]) -> WallMap:
    scans = [scan_in(walls, pose, seed) for seed, pose in enumerate(poses)]
    points = np.concatenate([placed(s.points, p) for s, p in zip(scans, poses, strict=True)])
    normals = [placed(s.normals, p, turned_only=True) for s, p in zip(scans, poses, strict=True)]
    return WallMap(points, np.concatenate(normals), CELL)


def test_a_pose_after_its_inverse_is_the_origin() -> None:
    pose = (1.0, 2.0, 0.5)
    assert compose(inverse(pose), pose) == pytest.approx((0.0, 0.0, 0.0))


def test_half_a_second_at_2_m_per_s_on_a_circle_of_4_m_turns_a_quarter_of_a_radian() -> None:
    x, y, turn = dead_reckoning((2.0, 0.0, 0.5), (2.0, 0.0, 0.5), 0.5)
    assert turn == pytest.approx(0.25)
    assert (x, y) == pytest.approx((4.0 * math.sin(0.25), 4.0 * (1.0 - math.cos(0.25))), abs=0.003)


@pytest.mark.parametrize("moved", [(0.08, -0.05, 0.05), (-0.06, 0.07, -0.06), (0.0, 0.0, 0.08)])
def test_a_scan_tells_its_displacement_to_1_cm_and_a_fifth_of_a_degree(moved: Pose) -> None:
    walls = map_from(ROOM, [(-0.5, -0.3, 0.2), (-0.5, -0.3, 2.2), (-0.5, -0.3, 4.2)])
    start = (-0.5, -0.3, 0.2)
    true = compose(start, moved)
    fit = walls.match(scan_in(ROOM, true, seed=9), start, (0.2, 0.2))
    assert fit.share > 0.9
    assert math.hypot(fit.pose[0] - true[0], fit.pose[1] - true[1]) < 0.01
    assert abs(fit.pose[2] - true[2]) < math.radians(0.2)


def test_a_straight_corridor_leaves_the_way_along_it_to_the_odometry() -> None:
    corridor = np.array([(-50.0, 0.5, 50.0, 0.5), (-50.0, -0.5, 50.0, -0.5)])
    walls = map_from(corridor, [(0.0, 0.0, 0.0)])
    guess = (0.3, 0.03, 0.0)
    fit = walls.match(scan_in(corridor, (0.3, 0.0, 0.0), seed=5), guess, (0.02, 0.05))
    assert fit.pose[0] == pytest.approx(0.3, abs=0.01)
    assert fit.pose[1] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("end", "closes"), [(50.0, False), (4.0, True)])
def test_a_lap_closes_where_walls_face_both_ways(end: float, closes: bool) -> None:
    corridor = np.array([(-50.0, 0.5, end, 0.5), (-50.0, -0.5, end, -0.5), (end, -0.5, end, 0.5)])
    survey = LapSurvey(CELL, LENGTH)
    for seed in range(20):
        scan = scan_in(corridor, (0.1 * seed, 0.0, 0.0), seed)
        survey.add(scan, (0.1, 0.0, 0.0) if seed else (0.0, 0.0, 0.0), 0.1 if seed else 0.0)
    survey.add(scan_in(corridor, (0.5, 0.0, 0.0), 30), (0.1, 0.0, 0.0), 0.1)
    # As if it had driven 20 m and once round, to a metre from where it is.
    survey.poses[-1], survey.ways[-1] = (1.5, 0.0, 2.0 * math.pi), 20.0
    end_of_lap = survey.closing()
    assert (end_of_lap is not None) == closes
    if end_of_lap is not None:
        assert end_of_lap.pose[0] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("after", "past"),
    [
        ((20.0, 0.0, 2.2 * math.pi), True),  # far off again
        ((1.0, 0.0, 3.9 * math.pi), True),  # a second time round a small course
        ((1.0, 0.0, 3.0 * math.pi), False),
    ],
)
def test_a_lap_is_past_where_it_was_beside_its_start_and_did_not_close(
    after: Pose, past: bool
) -> None:
    survey = LapSurvey(CELL, LENGTH)
    # What a lidar sees before a wall, that is not to be found again, and in the end.
    for seed in range(2):
        survey.add(scan_in(OVAL, (0.0, -2.0, 0.0), seed), (0.5, 0.0, 0.0), 0.5)
    survey.ways[-1] = 30.0
    for pose in ((20.0, 0.0, 3.0 * math.pi), (1.0, 0.0, 2.0 * math.pi)):
        survey.poses[-1] = pose
        survey.scans[-1] = scan_in(ROOM, (0.0, 0.0, 1.0), seed=4)
        assert survey.closing() is None
        assert not survey.is_past
    survey.poses[-1] = after
    assert survey.closing() is None
    assert survey.is_past == past


def test_a_lidar_that_met_nothing_makes_a_map_that_nothing_fits() -> None:
    nothing = np.zeros((0, 2))
    empty = WallMap(nothing, nothing, CELL)
    assert not read_scan(np.full(201, REACH), FIELD, REACH, 0.0, CELL).is_placed
    assert (
        empty.match(scan_in(ROOM, (0.0, 0.0, 0.0), seed=1), (0.0, 0.0, 0.0), (1.0, 1.0)).share
        == 0.0
    )
    assert not empty.is_known(np.array([(0.0, 0.0), (5.0, 5.0)])).any()


def circle(turn: float) -> list[Pose]:
    """Return 101 poses on a circle of 3 m, whose headings turn by a share of what they should."""
    poses = [(0.0, 0.0, 0.0)]
    step, way = 2.0 * math.pi / 100, 2.0 * math.pi * 3.0 / 100
    for _ in range(100):
        half = 0.5 * step * turn
        moved = (way * math.cos(half), way * math.sin(half), step * turn)
        poses.append(compose(poses[-1], moved))
    return poses


def test_a_circle_that_turned_1_percent_too_far_closes_to_1_cm() -> None:
    ways = [3.0 * 2.0 * math.pi * index / 100 for index in range(101)]
    bent = spread_error(circle(turn=1.01), ways, (0.0, 0.0, 2.0 * math.pi))
    assert bent[-1] == pytest.approx((0.0, 0.0, 2.0 * math.pi), abs=1e-9)
    assert np.abs(path_of(bent) - path_of(circle(turn=1.0))).max() < 0.01


def oval(offset: float) -> Floats:
    """Return an oval of straights of 4 m and bends of 2 m, moved outwards by an offset [m]."""
    angles = np.linspace(0.0, math.pi, 40)
    bend = (2.0 + offset) * np.column_stack([np.sin(angles), -np.cos(angles)])
    right = bend + np.array([2.0, 0.0])
    return np.concatenate([right, -right])


OVAL = np.concatenate([segments_of(oval(0.6)), segments_of(oval(-0.4))])  # 1 m wide


def pose_at(way: float) -> Pose:
    """Return the pose on the oval after a way from the middle of its lower straight."""
    way %= 8.0 + 4.0 * math.pi
    if way > 4.0 + 2.0 * math.pi:
        x, y, heading = pose_at(way - 4.0 - 2.0 * math.pi)
        return -x, -y, heading + math.pi
    if way < 2.0 or way > 2.0 + 2.0 * math.pi:
        rest = way if way < 2.0 else 4.0 + 2.0 * math.pi - way
        return rest, -2.0 if way < 2.0 else 2.0, 0.0 if way < 2.0 else math.pi
    turn = (way - 2.0) / 2.0
    return 2.0 + 2.0 * math.sin(turn), -2.0 * math.cos(turn), turn


@cache
def surveyed() -> tuple[LapSurvey, Pose, float]:
    """Return a survey with wheels that count 1 % too much, its end, and the way to there."""
    survey, way, step = LapSurvey(CELL, LENGTH), 0.0, 0.35
    survey.add(scan_in(OVAL, pose_at(0.0), seed=0), (0.0, 0.0, 0.0), 0.0)
    while way < 30.0:
        x, y, turn = compose(inverse(pose_at(way)), pose_at(way + step))
        way += step
        moved = (1.01 * x, 1.01 * y, math.remainder(turn, 2.0 * math.pi))
        survey.add(scan_in(OVAL, pose_at(way), seed=int(100 * way)), moved, 1.01 * step)
        if (end := survey.closing()) is not None:
            return survey, end.pose, way
    raise AssertionError("the lap did not close")


def test_a_lap_with_wheels_1_percent_off_closes_within_3_cm_of_where_it_is() -> None:
    _, end, way = surveyed()
    x, y, heading = compose(inverse(pose_at(0.0)), pose_at(way))
    assert way - 8.0 - 4.0 * math.pi < 0.8
    assert end[:2] == pytest.approx((x, y), abs=0.03)
    assert math.remainder(end[2] - heading, 2.0 * math.pi) == pytest.approx(0.0, abs=0.01)


@cache
def charted() -> tuple[LapSurvey, list[Pose], tuple[Floats, Floats], Floats]:
    survey, end, _ = surveyed()
    poses = survey.closed(end)
    path = path_of(poses)[: len(poses) - 1]
    return survey, poses, borders_along(path, survey.map_at(poses)), path


def test_the_oval_is_1_m_wide_everywhere_to_3_cm() -> None:
    _, _, (left, right), path = charted()
    course = course_between(left, right, path, "1/10")
    widths = course.half_widths.sum(axis=1)
    assert np.abs(widths - 1.0).max() < 0.03
    # The wheels count 1 % too much, and nothing but them tells how long a straight is.
    assert course.length == pytest.approx(8.0 + 2.0 * math.pi * 2.1, rel=0.015)


def test_a_bent_wall_to_be_driven_around_keeps_its_area_of_2_m2() -> None:
    bent = np.array([(-3, 1.6), (0, 0.4), (3, 1.6), (3, 1.3), (0, 0.0), (-3, 1.3)])
    turns = np.linspace(0.0, 2.0 * math.pi, 61)[:-1]
    around = np.column_stack([6.2 * np.cos(turns), 4.4 * np.sin(turns)])
    walls = np.concatenate([segments_of(around), segments_of(bent)])
    x, y = 4.6 * np.cos(turns), 2.8 * np.sin(turns)
    poses = [
        (x, y, math.atan2(2.8 * math.cos(turn), -4.6 * math.sin(turn)))
        for x, y, turn in zip(x, y, turns, strict=True)
    ]
    left, right = borders_along(path_of(poses), map_from(walls, poses))
    assert not len(crossings(segments_of(left)))
    assert area_of(left) == pytest.approx(0.5 * (0.3 + 0.4) * 6.0, abs=0.3)
    assert area_of(right) == pytest.approx(math.pi * 6.2 * 4.4, rel=0.01)


def test_a_tip_without_a_direction_is_a_wall_since_no_ray_went_through_it() -> None:
    fence = np.array([[0.0, -2.6, 0.0, -2.2]])  # into the lower straight, from its outer wall
    poses = [pose_at(way) for way in np.arange(0.0, 8.0 + 4.0 * math.pi, 0.3)]

    def unseen(walls: Floats) -> Floats:
        scans = [scan_in(walls, pose, seed) for seed, pose in enumerate(poses)]
        return walls_unseen(scans, poses, oval(-0.4), oval(0.6), CELL)

    assert not len(unseen(OVAL))
    x, y, *_ = unseen(np.concatenate([OVAL, fence])).T
    assert np.abs(x[y > -2.4]).max() < 1.5 * CELL
    assert y.max() == pytest.approx(-2.2, abs=CELL)


@cache
def chart_of_the_oval() -> Chart:
    survey, poses, _, _ = charted()
    return chart_lap(survey.scans, poses, CELL, vehicle_named("tt02"))


def look_from(charting: Charting, tick: int, way: float, speed: float, lights: float) -> bool:
    """Return whether a kart on the oval has a line to follow."""
    layout = layout_of("lidar", 201)
    values = np.zeros(layout.size, np.float32)
    at = compose(pose_at(way), (MOUNT, 0.0, 0.0))
    turns = speed * (pose_at(way + 0.01)[2] - pose_at(way)[2]) / 0.01
    shown = {"speed": speed, "yaw_rate": turns, "lights": lights, "speed_cap": 8.0}
    for part, value in {**shown, "lidar": ranges_in(OVAL, at, tick)}.items():
        values[layout.slices[part]] = value
    return charting.look(Observation(tick, layout, values)) is not None


def lap_and_more(charting: Charting) -> list[bool]:
    """Return whether there was a line, at each of 160 decisions at 3 m/s."""
    ticks = ticks_of(0.1)
    return [look_from(charting, step * ticks, 0.3 * step, 3.0, 0.0) for step in range(160)]


@pytest.mark.parametrize(("lights", "forgotten"), [(0.0, True), (1.0, False)])
def test_a_kart_that_stands_on_its_chart_for_4_s_forgets_it(
    monkeypatch: pytest.MonkeyPatch, lights: float, forgotten: bool
) -> None:
    monkeypatch.setattr("race_agents.planning.charting.ask_chart", lambda *_: chart_of_the_oval())
    charting = Charting(briefing("lidar", lidar_field=FIELD, lidar_reach=REACH))
    drives = lap_and_more(charting)
    assert not any(drives[:65])
    assert drives[-1]
    ticks = ticks_of(0.1)
    stands = [
        look_from(charting, (160 + step) * ticks, 0.3 * 159, 0.0, lights) for step in range(50)
    ]
    assert all(stands[:38])
    assert stands[-1] != forgotten


@pytest.mark.parametrize("waits", [True, False])
def test_a_world_that_waits_has_its_line_however_late_the_solver_is(
    monkeypatch: pytest.MonkeyPatch, waits: bool
) -> None:
    """Its clock goes on by an hour at each glance, and the solver takes a second."""
    chart, hours = chart_of_the_oval(), count(0.0, 3600.0)
    clock = SimpleNamespace(monotonic=lambda: next(hours))
    monkeypatch.setattr("race_agents.planning.charting.time", clock)
    last = Event()

    def ask_late(*_: object) -> Chart:
        last.wait(1.0 if waits else 60.0)
        return chart

    monkeypatch.setattr("race_agents.planning.charting.ask_chart", ask_late)
    told = briefing("lidar", lidar_field=FIELD, lidar_reach=REACH, waits=waits)
    drives = lap_and_more(Charting(told))
    last.set()
    assert drives[-1] == waits


def test_a_line_keeps_to_the_middle_where_the_course_has_no_more_room() -> None:
    # 0.47 m: a model car of 0.19 m, 0.05 m to each side, and 0.09 m that are not enough.
    line = line_on(ring(radius=3.0, half_width=0.235), vehicle_named("tt02"))
    assert not line.note
    assert np.hypot(line.x, line.y) == pytest.approx(3.0, abs=0.011)
    # It shows the course as wide as it is.
    assert line.left + line.right == pytest.approx(0.47, abs=0.005)


def test_a_tip_of_the_right_wall_takes_room_on_the_right_alone() -> None:
    # Counter-clockwise between radii of 2.4 and 3.6 m, on one of 3.3 m. From most of the lap the
    # tip lies to the left.
    course = ring(radius=3.0, half_width=0.6)
    tip = segments_of(np.array([(3.5, -0.05), (3.6, -0.05), (3.6, 0.05), (3.5, 0.05)]))
    course = replace(course, borders=np.concatenate([course.borders, tip]))
    turns = np.linspace(0.0, 2.0 * math.pi, 60, endpoint=False)
    points = 3.3 * np.column_stack([np.cos(turns), np.sin(turns)])
    left, right = attach._ways_to_borders(course, points, turns + 0.5 * math.pi)
    assert left == pytest.approx(0.9, abs=0.01)
    assert right[[0, 30]] == pytest.approx((0.2, 0.3), abs=0.01)


def test_a_kart_that_was_put_elsewhere_is_found_again() -> None:
    seen_from = [(-0.5, -0.3, 0.2), (-0.5, -0.3, 2.2), (-0.5, -0.3, 4.2)]
    finder = Wayfinder(map_from(ROOM, seen_from), (1.0, -0.5, 2.0))
    true = (-1.2, 0.5, 0.6)
    for seed in range(4):
        finder.move(scan_in(ROOM, true, seed=seed), (0.0, 0.0, 0.0), 0.0)
    assert finder.is_lost
    places = np.array(
        [(x, y, 0.5 + turn) for x in (-1.1, 0.2) for y in (-0.6, 0.6) for turn in (0.0, 0.2)]
    )
    for seed in range(4):
        finder.search(scan_in(ROOM, true, seed=seed), places)
    assert not finder.is_lost
    assert finder.pose == pytest.approx(true, abs=0.02)


def test_what_stands_on_the_course_is_shown_as_a_kart_that_stands() -> None:
    survey, poses, (left, right), path = charted()
    vehicle = vehicle_named("tt02")
    course = course_between(left, right, path, "1/10")
    view = LineView(stand_in(course, bounds_of(vehicle), ""), survey.map_at(poses), vehicle)
    box = segments_of(np.array([(1.4, -2.1), (1.6, -2.1), (1.6, -1.9), (1.4, -1.9)]))
    ranges = ranges_in(np.concatenate([OVAL, box]), pose_at(0.0), seed=3)
    for _ in range(2):
        view.look(ranges, FIELD, 0.0, (0.0, 0.0, 0.0), 0.1)
    assert len(view.others) == 1
    x, y, *velocity = view.others[0]
    assert (x, y) == pytest.approx((1.5, 0.0), abs=0.15)
    assert velocity == pytest.approx((0.0, 0.0), abs=0.1)
    layout = layout_of("lidar", 201)
    seen = Observation(0, layout, np.zeros(layout.size, np.float32))
    shown = view.observe(seen, (0.0, 0.0, 0.0), 0.2)
    for part, wanted in (("karts_x", 1.5), ("karts_along", 1.5), ("karts_across", 0.0)):
        assert shown[part][0] == pytest.approx(wanted, abs=0.2)
    assert shown["karts_along"][1] == shown["boxes_y"][0] == 1000.0
