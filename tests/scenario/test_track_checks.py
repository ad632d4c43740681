"""What a check of a track finds where nothing can drive: obstacles, starts, items, slots."""

from pathlib import Path

import numpy as np
import pytest

from race_server.core.vehicle_presets import KART_60, TT02
from race_server.errors import TrackError
from race_server.scenario.places import own_folder
from race_server.scenario.track.check import check_course
from race_server.scenario.track.load import read_course

# Two straights along y = -1.5 m and y = 1.5 m, 1.2 m wide, driven counter-clockwise.
OVAL = (own_folder("tracks") / "oval.toml").read_text()


def errors_of(tmp_path: Path, before: str, behind: str = "") -> list[str]:
    """Return the errors for a car 0.19 m wide, which needs 0.25 m, on the oval with more lines."""
    path = tmp_path / "mine.toml"
    path.write_text(f"{before}\n{OVAL}\n{behind}")
    return [one.what for one in check_course(read_course(path), TT02) if one.level == "error"]


# Obstacles


@pytest.mark.parametrize(
    "rows",
    [
        "[3, 0, 0, 1, 5]",  # across both straights
        "[2, -1.5, 0, 0.005, 1.2]",  # a sheet between two samples of the line
        "[2, -1.5, 30, 0.005, 1.3]",
        "[2, -1.3, 0, 1, 0.5], [2, -1.85, 0, 1, 0.3]",  # 0.15 m between two, 0.10 m beside them
        "[4.5, 0, 0, 3, 0.01]",  # in a bend
        "[0, 0, 0, 1e4, 1e4]",
    ],
)
def test_where_obstacles_leave_less_than_a_car_needs_there_is_an_error(
    rows: str, tmp_path: Path
) -> None:
    (error,) = errors_of(tmp_path, f"obstacles = [{rows}]")
    assert error.startswith("obstacles leave 0.")
    assert error.endswith("; tt02 needs 0.29 m: move them, or make them smaller")


@pytest.mark.parametrize(
    "rows",
    [
        "[2, -1.1, 0, 1, 0.5]",  # 0.75 m stay free on the right of it
        "[1, -1.1, 0, 0.1, 0.7], [2.5, -1.9, 0, 0.1, 0.7]",  # first on the left, then on the right
        "[2, -1.5, 0, 0.3, 0.6]",  # 0.30 m on either side
        "[0, -3, 0, 3, 0.5], [90, 90, 0, 99, 1]",  # outside of the borders
    ],
)
def test_obstacles_that_a_car_can_pass_are_good(rows: str, tmp_path: Path) -> None:
    assert errors_of(tmp_path, f"obstacles = [{rows}]") == []


def test_an_obstacle_1_m_wide_on_a_course_of_1_2_m_leaves_0_2_m(tmp_path: Path) -> None:
    (error,) = errors_of(tmp_path, "obstacles = [[0, -1.4, 0, 1, 1.0]]")
    assert error.startswith("obstacles leave 0.20 m to pass at (-0.6")


def test_two_obstacles_15_cm_apart_along_the_course_are_one(tmp_path: Path) -> None:
    rows = "[2, -1.2, 0, 0.1, 0.7], [{x}, -1.8, 0, 0.1, 0.7]"
    assert errors_of(tmp_path, f"obstacles = [{rows.format(x=2.25)}]") != []
    assert errors_of(tmp_path, f"obstacles = [{rows.format(x=3.0)}]") == []


def test_a_lane_that_ends_leads_nowhere(tmp_path: Path) -> None:
    # A wall along the straight parts it into two lanes of 0.57 m.
    lanes = "[0, -1.5, 0, 3, 0.05], [-1, -1.2, 0, 0.1, 0.65], [1, {y}, 0, 0.1, 0.65]"
    assert errors_of(tmp_path, f"obstacles = [{lanes.format(y=-1.2)}]") == []
    (error,) = errors_of(tmp_path, f"obstacles = [{lanes.format(y=-1.8)}]")
    assert "obstacles leave 0.00 m to pass" in error


def test_the_grass_beside_a_course_can_be_driven_on(tmp_path: Path) -> None:
    wall = "obstacles = [[0, -1.5, 0, 1, 1.2]]"
    assert len(errors_of(tmp_path, wall)) == 1
    assert errors_of(tmp_path, f"{wall}\ngrass = 0.3") == []


# Starts, items, slots


@pytest.mark.parametrize(
    ("before", "behind", "error"),
    [
        (
            "starts = [[0, 1, -1.6, -1.4, 0, 0], [100, 101, 100, 101, 0, 0]]",
            "",
            "1 of 2 starts reach out of the borders, number 2 at (100.50, 100.50)",
        ),
        (
            "starts = [[0, 1, -1.8, 1.8, 0, 0]]",  # from one straight to the other
            "",
            "1 of 1 starts reach out of the borders, number 1 at (0.50, 0.00)",
        ),
        (
            "items = [[3, 0], [4, 50], [5, -50]]",
            "",
            "2 of 3 items reach out of the borders, number 2 at",
        ),
        (
            "",
            "[[slots]]\nat = [100, 100]\ncount = 2\n",
            "2 of 2 slots reach out of the borders, number 1 at (100.00, 100.00)",
        ),
        (
            "",
            "[[slots]]\nat = [0, -1.5]\nlength = 1.0\nwidth = 1.3\n",  # wider than the course
            "1 of 1 slots reach out of the borders, number 1 at (0.00, -1.50)",
        ),
    ],
)
def test_what_lies_outside_of_the_borders_is_an_error(
    before: str, behind: str, error: str, tmp_path: Path
) -> None:
    (found,) = errors_of(tmp_path, before, behind)
    assert found.startswith(error)
    assert found.endswith("; move them between the borders")


def test_starts_items_and_slots_between_the_borders_are_good(tmp_path: Path) -> None:
    before = "starts = [[0, 1, -1.8, -1.2, 0, 0], [2, 2, 1.5, 1.5, 180, 0]]\nitems = [[4, 0.5]]"
    slots = "[[slots]]\nat = [0, 1.5]\nlength = 1.0\nwidth = 0.5\n"
    assert errors_of(tmp_path, before, slots) == []


# Half-widths


@pytest.mark.parametrize("number", ["1e9", "100.1", "0", "-1", "nan", "9" * 400])
def test_a_half_width_that_no_course_has_is_refused(number: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(OVAL.replace("half_width = 0.6", f"half_width = {number}"))
    with pytest.raises(TrackError, match=r"half_width = .*: give metres above 0, up to 100$"):
        read_course(path)


@pytest.mark.parametrize("number", ["1e4", "100.1", "0", "-1"])
def test_a_point_with_a_half_width_that_no_course_has_is_refused(
    number: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f'form = "spline"\npoints = [[0, 0, 1, 1], [9, 0, 1, {number}], [9, 9, 1, 1]]')
    with pytest.raises(TrackError, match=r"points\[2\] = .*: half-widths are above 0 and up to 10"):
        read_course(path)


# Whole numbers


@pytest.mark.parametrize("line", ["gates = 12.5", "sectors = 2.4", "grid_places = 1.5"])
def test_a_number_of_things_is_whole(line: str, tmp_path: Path) -> None:
    key, value = line.split(" = ")
    with pytest.raises(TrackError, match=rf"{key} = {value}: give a whole number from \d+ to \d+$"):
        errors_of(tmp_path, line)
    assert errors_of(tmp_path, f"{key} = 12.0") == []


# Stretches that merge


@pytest.mark.parametrize(("half_width", "merges"), [(1.0, True), (0.7, False)])
def test_stretches_that_overlap_have_no_border_between_them(
    half_width: float, merges: bool, tmp_path: Path
) -> None:
    # A bone: between its lobes two straights along y = 0.75 m and y = -0.75 m.
    t = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    rows = np.column_stack([12.0 * np.cos(t), np.sin(t) * (0.75 + 6.0 * np.cos(t) ** 8)])
    path = tmp_path / "bone.toml"
    path.write_text(f'form = "line"\nhalf_width = {half_width}\npoints = {rows.tolist()}')
    told = [one for one in check_course(read_course(path), TT02) if "overlaps" in one.what]
    assert [one.level for one in told] == ["warning"] * merges


# Grid


def test_a_kart_track_that_does_not_say_so_is_told_its_scale(tmp_path: Path) -> None:
    words = (own_folder("tracks") / "hangar-400.toml").read_text()
    (tmp_path / "mine.toml").write_text(words.replace('scale = "kart"\n', ""))
    course = read_course(tmp_path / "mine.toml")
    (error,) = [one.what for one in check_course(course, KART_60) if one.level == "error"]
    assert error.startswith("two grid places are 0.")
    assert error.endswith('give the course scale = "kart"')


def test_a_course_shorter_than_two_turning_radii_is_an_error_and_not_a_crash(
    tmp_path: Path,
) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False)
    points = 0.2 * np.column_stack([np.cos(angles), np.sin(angles)])
    path = tmp_path / "tiny.toml"
    path.write_text(f'form = "line"\nhalf_width = 0.05\npoints = {points.tolist()}\n')
    found = [one.what for one in check_course(read_course(path), TT02) if one.level == "error"]
    assert "no place for a start grid" in found
