"""Cases of the benchmark TPCAP: read, turned into car parks, and refused where they are damaged."""

import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from race_server.cli.lot import app
from race_server.core.vehicle_presets import CAR
from race_server.errors import LotError
from race_server.scenario.lot.check import check_lot
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.tpcap import MOST_NUMBERS, MOST_POLYGONS, import_case, read_case
from race_server.scenario.track.polyline import area_of

# From the middle of the rear axle to that of the body: 4.689 / 2 - 0.929 m.
AHEAD = 1.4155
START, GOAL = [-10.0, 3.5, 0.0], [4.0, -1.3, math.pi]
# Two boxes with a gap of 6.20 m between them, and a triangle.
LEFT = [(-9.0, 0.0), (-9.0, -3.0), (-1.0, -3.0), (-1.0, 0.0)]
RIGHT = [(5.2, 0.0), (5.2, -3.0), (12.0, -3.0), (12.0, 0.0)]
ABOVE = [(-12.0, 8.0), (14.0, 8.0), (1.0, 9.5)]

Loop = list[tuple[float, float]]


def numbers(*loops: Loop, start: list[float] = START, goal: list[float] = GOAL) -> list[float]:
    counts = [float(len(loop)) for loop in loops]
    points = [number for loop in loops for corner in loop for number in corner]
    return [*start, *goal, float(len(loops)), *counts, *points]


def write(tmp_path: Path, content: list[float] | str, between: str = ",") -> Path:
    path = tmp_path / "Case1.csv"
    text = content if isinstance(content, str) else between.join(map(repr, content))
    path.write_text(text)
    return path


@pytest.mark.parametrize("between", [",", "\n", " ; "])
def test_a_case_is_one_list_of_numbers_in_a_row_or_a_column(tmp_path: Path, between: str) -> None:
    case = read_case(write(tmp_path, numbers(LEFT, RIGHT, ABOVE), between))
    assert [len(polygon) for polygon in case.polygons] == [4, 4, 3]
    assert sorted(map(tuple, case.polygons[2].tolist())) == sorted(ABOVE)


def test_poses_are_those_of_the_rear_axle_and_become_those_of_the_body(tmp_path: Path) -> None:
    case = read_case(write(tmp_path, numbers()))
    assert case.start == pytest.approx((-10.0 + AHEAD, 3.5, 0.0))
    assert case.goal[:2] == pytest.approx((4.0 - AHEAD, -1.3))
    assert abs(case.goal[2]) == pytest.approx(math.pi)
    # 8 m beyond both: x from -8.5845 to 2.5845, y from -1.3 to 3.5, rounded outwards.
    assert case.area == pytest.approx((-16.6, 10.6, -9.3, 11.5))


def test_a_case_ten_million_kilometres_from_its_origin_is_the_same_case(tmp_path: Path) -> None:
    here = read_case(write(tmp_path, numbers(LEFT, RIGHT)))
    shift = (7.0086e9, -8.7223e9)
    far = [[(x + shift[0], y + shift[1]) for x, y in loop] for loop in (LEFT, RIGHT)]
    poses = [[pose[0] + shift[0], pose[1] + shift[1], pose[2]] for pose in (START, GOAL)]
    there = read_case(write(tmp_path, numbers(*far, start=poses[0], goal=poses[1])))
    assert there.start == pytest.approx(here.start, abs=1e-5)
    assert there.goal == pytest.approx(here.goal, abs=1e-5)
    assert there.polygons[1] == pytest.approx(here.polygons[1], abs=1e-5)


def test_polygons_are_clockwise_however_they_were_written(tmp_path: Path) -> None:
    for loop in (LEFT, LEFT[::-1], [*LEFT, LEFT[0]]):
        (polygon,) = read_case(write(tmp_path, numbers(loop))).polygons
        assert area_of(polygon) == pytest.approx(-24.0)
        assert len(polygon) == 4


def test_a_case_becomes_a_lot_with_one_start_and_one_goal(tmp_path: Path) -> None:
    target = tmp_path / "case.toml"
    course = import_case(write(tmp_path, numbers(LEFT, RIGHT, ABOVE)), target, title='A "case"')
    assert course.title == 'A "case"'
    lot = course.lot
    assert lot is not None
    assert (lot.vehicle, lot.level) == ("car", "parked")
    # 0.27 m are left ahead of the body and 0.4 m behind it: the slot has 0.15 m on every side.
    assert lot.slot_size == pytest.approx((CAR.length + 0.3, CAR.width + 0.3), abs=1e-3)
    start, goal = lot.zones
    assert start.x == pytest.approx((-8.5845, -8.5845), abs=1e-6)
    assert goal.heading == pytest.approx(math.pi, abs=1e-6)
    assert len(course.borders) == 4 + 4 + 4 + 3
    assert check_lot(str(target), rounds=3) == []


def test_the_slot_takes_no_more_room_than_the_obstacles_leave(tmp_path: Path) -> None:
    # The rear bumper is at 4.929 m, the obstacle 0.06 m behind it.
    near = [(x - 5.2 + 4.989, y) for x, y in RIGHT]
    target = tmp_path / "case.toml"
    course = import_case(write(tmp_path, numbers(LEFT, near)), target, title="near")
    assert course.lot is not None
    assert course.lot.slot_size == pytest.approx((CAR.length + 0.1, CAR.width + 0.1), abs=1e-3)


def test_a_goal_in_two_obstacles_that_begin_in_one_corner_is_refused(tmp_path: Path) -> None:
    around = [(-1.0, -6.0), (8.0, -6.0), (8.0, 2.0), (-1.0, 2.0)]
    target = tmp_path / "case.toml"
    with pytest.raises(LotError, match=r"at the goal the car of the benchmark touches the polygon"):
        import_case(write(tmp_path, numbers(around, around)), target, title="x")


def test_what_lies_outside_of_the_area_is_left_out_however_far(tmp_path: Path) -> None:
    # The area ends at x = 10.6 m; a tower begins there, and a house stands 300 m away.
    tower = [(10.7, 4.0), (12.0, 4.0), (12.0, 6.0), (10.7, 6.0)]
    house = [(300.0, 0.0), (310.0, 0.0), (310.0, 9.0)]
    near = [(x - 1.0, y) for x, y in tower]
    target = tmp_path / "case.toml"
    course = import_case(write(tmp_path, numbers(LEFT, tower, house, near)), target, title="x")
    assert len(course.borders) == 4 + 4 + 4
    assert (course.borders[8:, 0].min(), course.borders[8:, 0].max()) == (9.7, 11.0)


def test_a_body_in_an_obstacle_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    target = tmp_path / "case.toml"
    inside = [(-11.0, 2.0), (-6.0, 2.0), (-6.0, 5.0), (-11.0, 5.0)]
    with pytest.raises(LotError, match=r"at the start the car of the benchmark touches the polyg"):
        import_case(write(tmp_path, numbers(inside)), target, title="x")
    near = [(x - 5.2 + 4.9, y) for x, y in RIGHT]
    with pytest.raises(LotError, match=r"at the goal the car of the benchmark touches the polygon"):
        import_case(write(tmp_path, numbers(near)), target, title="x")
    assert not target.exists()


DAMAGES: dict[str, tuple[list[float] | str, str]] = {
    "empty": ("", r"0 numbers; a case begins with 7: start x, y, heading, goal x, y, heading"),
    "words": ("1,2,3\n4,five", r"line 2: 'five' is no number"),
    "no number": ("1,2,nan", r"line 1: 'nan' is no number"),
    "far away": ("1,2,3,1e12", r"line 1: 1e12: give up to 1e\+11"),
    "far apart": ([0.0, 0.0, 0.0, 9e3, 0.0, 0.0, 0.0], r"9e\+03 m from the start: give up to 2000"),
    "half an obstacle": ([*START, *GOAL, 1.5], r"number of obstacles = 1.5: give a whole number"),
    "many obstacles": (
        [*START, *GOAL, 999.0],
        rf"number of obstacles = 999: give a whole number, 0 to {MOST_POLYGONS}",
    ),
    "no counts": ([*START, *GOAL, 3.0, 4.0], r"3 obstacles, but the numbers of their corners are"),
    "two corners": ([*START, *GOAL, 1.0, 2.0, 1, 2, 3, 4], r"corners of obstacle 1 = 2: give a w"),
    "negative": ([*START, *GOAL, 1.0, -4.0], r"corners of obstacle 1 = -4: give a whole number"),
    "cut off": (numbers(LEFT)[:-1], r"7 numbers for 4 corners; give x and y of each, and nothing"),
    "too much": ([*numbers(LEFT), 1.0], r"9 numbers for 4 corners"),
    "too long": ("0," * (MOST_NUMBERS + 1), rf"more than {MOST_NUMBERS} numbers"),
    "decimal commas": ("0,5\n2\n0\n10,5\n2\n1,57\n0\n", r"; write decimals with a point"),
    "decimal commas in a line": ("0,5;2;0;10,5;2;1,57;0", r"; write decimals with a point"),
    "too large": ("0" * 2_000_000, r"larger than \d+ bytes"),
}


@pytest.mark.parametrize(
    "text",
    [
        "1,2 0\n20,2 0\n2\n4 4\n5,5 6,5 6,6 5,6\n8,8 9,8 9,9 8,9\n",
        "0,0;0;20,2;0;1;4;5;5;6;5;6;6;5;6",
    ],
)
def test_commas_between_whole_numbers_are_read(text: str, tmp_path: Path) -> None:
    assert read_case(write(tmp_path, text)).polygons[0].tolist() == [[5, 6], [6, 6], [6, 5], [5, 5]]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_case_is_one_sentence(damage: str, tmp_path: Path) -> None:
    content, sentence = DAMAGES[damage]
    with pytest.raises(LotError, match=r"Case1\.csv.*" + sentence) as told:
        read_case(write(tmp_path, content))
    assert "\n" not in str(told.value)


def test_a_polygon_that_crosses_itself_is_refused_and_no_file_stays(tmp_path: Path) -> None:
    target = tmp_path / "case.toml"
    bow = [(8.0, 4.0), (10.0, 6.0), (10.0, 4.0), (8.0, 7.0)]
    with pytest.raises(LotError, match="the sides of obstacle 1 cross"):
        import_case(write(tmp_path, numbers(bow)), target, title="x")
    assert not target.exists()


def test_a_case_is_not_written_over_by_its_own_lot(tmp_path: Path) -> None:
    source = write(tmp_path, numbers(LEFT)).rename(tmp_path / "case.toml")
    link = tmp_path / "link.toml"
    link.symlink_to(source)
    before = source.read_bytes()
    for target in (source, link):
        with pytest.raises(LotError, match=r"\.toml: the case itself, which would be written over"):
            import_case(source, target, title="x")
    assert source.read_bytes() == before


def test_what_no_lot_may_have_is_told_of_the_case_and_not_of_a_file_to_come(
    tmp_path: Path,
) -> None:
    source = write(tmp_path, numbers(start=[-600.0, 0.0, 0.0]))
    with pytest.raises(
        LotError,
        match=r"Case1\.csv: start and goal lie 604 m apart: an area has sides of up to 500 m",
    ):
        import_case(source, tmp_path / "case.toml", title="x")


@pytest.mark.parametrize("name", ["case.toml", "notes.txt"])
def test_an_import_that_fails_leaves_the_file_of_before(name: str, tmp_path: Path) -> None:
    target = tmp_path / name
    target.write_text("an hour of work")
    bow = [(8.0, 4.0), (10.0, 6.0), (10.0, 4.0), (8.0, 7.0)]
    with pytest.raises(LotError, match=r"obstacle 1 cross|the file of a lot ends in .toml"):
        import_case(write(tmp_path, numbers(bow)), target, title="x")
    assert target.read_text() == "an hour of work"
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted(["Case1.csv", name])


def test_the_command_says_what_it_wrote(tmp_path: Path) -> None:
    source, target = write(tmp_path, numbers(LEFT, RIGHT)), tmp_path / "case.toml"
    done = CliRunner().invoke(app, ["import", str(source), "--to", str(target)])
    assert done.exit_code == 0, done.output
    assert done.output == f"{target}: 27.2 × 20.8 m, 2 obstacles\n"
    assert np.isclose(target.stat().st_size, 700, atol=300)
    refused = CliRunner().invoke(app, ["import", str(source), "--to", str(tmp_path / "case.png")])
    assert isinstance(refused.exception, LotError)


def test_an_obstacle_that_reaches_far_out_is_cut_off_and_the_way_beside_it_stays(
    tmp_path: Path,
) -> None:
    long = [[-800.0, 6.0], [900.0, 6.0], [900.0, 7.0], [-800.0, 7.0]]
    lot = import_case(write(tmp_path, numbers(long)), tmp_path / "long.toml", title="Long")
    assert np.abs(lot.borders).max() < 100.0
    walls = lot.borders[(lot.borders[:, [1, 3]] == 6.0).all(axis=1)]
    assert len(walls) == 1
    assert load_lot(tmp_path / "long.toml").digest == lot.digest


def test_an_obstacle_is_counted_as_in_its_case(tmp_path: Path) -> None:
    far = [[500.0, 500.0], [501.0, 500.0], [501.0, 501.0]]
    crossed = [[4.0, 5.0], [6.0, 6.0], [6.0, 5.0], [4.0, 6.5]]
    with pytest.raises(LotError, match="the sides of obstacle 2 cross; give its corners in order"):
        import_case(write(tmp_path, numbers(far, crossed)), tmp_path / "t.toml", title="t")
    flat = [[4.0, 5.0], [5.0, 5.0], [6.0, 5.0]]
    with pytest.raises(LotError, match="corners of obstacle 2 lie on one line; give it an area"):
        import_case(write(tmp_path, numbers(far, flat)), tmp_path / "t.toml", title="t")


def test_an_obstacle_whose_box_alone_reaches_into_the_area_is_left_out(tmp_path: Path) -> None:
    slanted = [[800.0, -900.0], [-900.0, -900.0], [-900.0, 800.0]]
    lot = import_case(write(tmp_path, numbers(LEFT, slanted)), tmp_path / "t.toml", title="t")
    assert len(lot.borders) == 4 + 4


def test_a_goal_with_little_room_has_a_slot_that_the_car_fits_into(tmp_path: Path) -> None:
    """A wall stands 3 cm beside the body; a slot has to be 5 cm wider than it."""
    x, y, _ = GOAL
    beside = y + 0.5 * CAR.width + 0.03
    wall = [(x - 5.0, beside), (x + 2.0, beside), (x + 2.0, beside + 1.0), (x - 5.0, beside + 1.0)]
    lot = import_case(write(tmp_path, numbers(wall)), tmp_path / "t.toml", title="t").lot
    assert lot is not None
    assert lot.slot_size[1] == pytest.approx(CAR.width + 0.05, abs=1e-3)
