"""What a check of a car park finds: rectangles, ways, rounds. And its command."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from race_server.cli.lot import app
from race_server.core.vehicle_presets import CAR, KART_13, vehicle_named
from race_server.core.vehicles import Vehicle
from race_server.errors import ScenarioError
from race_server.scenario.lot.check import check_lot, hopeless
from race_server.scenario.lot.faults import faults_of
from race_server.scenario.lot.footprint import Footprint, wall_under
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.ways import Ways, cut_off
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world
from support.lots import ONE_BAY, load_text

GATE = f"walls = [[20, 0, 20, {{low}}], [20, {{high}}, 20, 20]]{ONE_BAY}"

rectangles = st.builds(
    Footprint,
    *(st.floats(-3.0, 3.0) for _ in range(2)),
    st.floats(-math.pi, math.pi),
    *(st.floats(0.5, 4.0) for _ in range(2)),
)


def write(tmp_path: Path, text: str) -> str:
    path = tmp_path / "lot.toml"
    path.write_text(text)
    return str(path)


def parted_in(name: str, vehicle: Vehicle) -> list[str]:
    return cut_off(Ways(load_lot(name), vehicle))


def gate(tmp_path: Path, gap: float) -> str:
    """Return the file of a lot with a gap of this width [m] between start and slot."""
    low, high = 10.0 - 0.5 * gap - 0.05, 10.0 + 0.5 * gap + 0.05
    return write(tmp_path, GATE.format(low=low, high=high))


def points_in(place: Footprint) -> np.ndarray:
    """Return 41 by 41 points of a rectangle."""
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-0.5, 0.5, 41))
    cos, sin = math.cos(place.heading), math.sin(place.heading)
    along, across = u.ravel() * place.length, v.ravel() * place.width
    return np.stack(
        [place.x + along * cos - across * sin, place.y + along * sin + across * cos], axis=1
    )


def holds(place: Footprint, points: np.ndarray) -> np.ndarray:
    """Return which points lie inside a rectangle."""
    cos, sin = math.cos(place.heading), math.sin(place.heading)
    dx, dy = (points - (place.x, place.y)).T
    ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
    return (abs(ahead) < 0.5 * place.length) & (abs(aside) < 0.5 * place.width)


# Rectangles


@given(rectangles, rectangles)
def test_rectangles_overlap_where_a_point_of_one_lies_in_the_other(
    one: Footprint, other: Footprint
) -> None:
    if holds(other.grown(-1e-6), points_in(one)).any():
        assert one.overlaps(other)
    # What points 0.1 m apart may miss is no deeper than that.
    elif not holds(other.grown(0.15), points_in(one)).any():
        assert not one.overlaps(other)


@given(rectangles, *(st.floats(-5.0, 5.0) for _ in range(4)))
def test_a_segment_crosses_a_rectangle_where_one_of_its_points_lies_inside(
    place: Footprint, x0: float, y0: float, x1: float, y1: float
) -> None:
    share = np.linspace(0.0, 1.0, 501)[:, None]
    points = np.array([x0, y0]) + share * np.array([x1 - x0, y1 - y0])
    crosses = bool(place.crosses(np.array([[x0, y0, x1, y1]]))[0])
    if holds(place.grown(-1e-6), points).any():
        assert crosses
    elif not holds(place.grown(0.02), points).any():
        assert not crosses


def test_segments_along_the_sides_of_a_rectangle_do_not_cross_it() -> None:
    place = Footprint(0.0, 0.0, 0.0, 4.0, 2.0)
    along = np.array([[-9.0, 1.0, 9.0, 1.0], [2.0, -9.0, 2.0, 9.0], [-9.0, 0.0, 9.0, 0.0]])
    assert place.crosses(along).tolist() == [False, False, True]


def test_what_lies_under_a_rectangle_is_named() -> None:
    course = load_lot("gate")
    size = (CAR.length, CAR.width)
    assert wall_under(course, Footprint(10.0, 20.0, 0.0, *size)) == ""
    assert wall_under(course, Footprint(20.0, 20.0, 0.0, *size)) == ""
    assert "obstacle at (20.00" in wall_under(course, Footprint(20.0, 10.0, 0.0, *size))
    assert "border" in wall_under(course, Footprint(1.0, 20.0, 0.0, *size))
    assert "border" in wall_under(course, Footprint(-10.0, 20.0, 0.0, *size))


# Ways


def test_a_car_of_1_94_m_finds_a_way_through_2_10_m_and_none_through_1_70_m(
    tmp_path: Path,
) -> None:
    assert parted_in(gate(tmp_path, 2.1), CAR) == []
    (sentence,) = parted_in(gate(tmp_path, 1.7), CAR)
    assert sentence == (
        "no free way leads from a start to slot 0 at (30.00, 10.00) m for car, 1.94 m wide"
    )
    assert parted_in(gate(tmp_path, 1.7), KART_13) == []


def test_places_on_one_side_of_a_wall_share_a_region_up_to_half_a_car_from_it(
    tmp_path: Path,
) -> None:
    ways = Ways(load_lot(gate(tmp_path, 1.0)), CAR)

    def at(x: float) -> set[int]:
        return ways.regions((x, x), (10.0, 10.0))

    half, coarse = 0.5 * CAR.width, 0.45  # [m] of it, three cells or four
    assert at(half + coarse) == at(20.0 - 0.05 - half - coarse) != at(20.05 + half + coarse)
    assert not at(half - coarse)
    assert not at(20.0 - 0.05 - half + coarse)


@pytest.mark.parametrize("is_reversed", [False, True])
def test_it_does_not_matter_in_which_order_start_zones_are_named(
    is_reversed: bool, tmp_path: Path
) -> None:
    # One zone lies left of a closed wall, as that of the bay's file; the other on both sides of it.
    head, wide = GATE.format(low=10, high=10).split("[[zones]]", 1)
    zones = [wide, '\nrole = "start"\nx = [5, 28]\ny = [5, 15]\n']
    text = "[[zones]]".join([head, *zones[:: -1 if is_reversed else 1]])
    assert parted_in(write(tmp_path, text), CAR) == []


def test_a_start_in_a_wall_and_a_goal_behind_one_are_told(tmp_path: Path) -> None:
    text = GATE.format(low=10, high=10) + "[[zones]]\nrole = 'goal'\nx = [25, 35]\ny = [2, 6]\n"
    text = text.replace("[[rows]]\nat = [30, 10]\nlength = 5.2\nwidth = 2.5\n", "slot = [5, 2.5]\n")
    found = parted_in(write(tmp_path, text), CAR)
    assert found == [
        "no free way leads from a start to the goal zone x 25 to 35, y 2 to 6 m for car, "
        "1.94 m wide"
    ]
    inside = GATE.format(low=4, high=16).replace("[5, 10]", "[20, 20]").replace("[5, 15]", "[2, 2]")
    found = parted_in(write(tmp_path, inside), CAR)
    assert found[0].startswith("start zone x 20 to 20, y 2 to 2 m lies in a wall: it has no place")


# Rounds


@pytest.mark.parametrize("name", ["yard-70", "aisle-90", "generated:yard:3", "generated:aisle:3"])
def test_ten_rounds_of_a_good_lot_have_a_place_for_everything(name: str) -> None:
    assert check_lot(name, rounds=10) == []


def test_a_start_that_is_too_near_to_a_wall_is_an_error(tmp_path: Path) -> None:
    # The middle of the car fits there, its front does not.
    text = GATE.format(low=4, high=16).replace("[5, 10]", "[18, 18]").replace("[5, 15]", "[2, 2]")
    (finding,) = check_lot(write(tmp_path, text), rounds=10)
    assert finding.level == "error"
    assert finding.what == (
        "in 10 of 10 rounds (100.0%) no free place was found for the start, first under the "
        "seed 0: it touches the obstacle at (20.00, 2.00) m; make its zone larger"
    )


def test_a_goal_zone_without_room_for_a_slot_is_an_error(tmp_path: Path) -> None:
    text = GATE.format(low=4, high=16) + "[[zones]]\nrole = 'goal'\nx = [39, 39]\ny = [10, 10]\n"
    text = text.replace("[[rows]]\nat = [30, 10]\nlength = 5.2\nwidth = 2.5\n", "slot = [5, 2.5]\n")
    (finding,) = check_lot(write(tmp_path, text), rounds=4)
    assert finding.level == "error"
    assert "for the slot, first under the seed 0: it touches the border" in finding.what


def test_blocks_that_find_no_room_are_a_warning(tmp_path: Path) -> None:
    text = GATE.format(low=4, high=16) + (
        "[[zones]]\nrole = 'blocks'\nx = [15, 16]\ny = [10, 11]\n"
        "[blocks]\ncount = [9, 9]\nside = [2, 3]\n"
    )
    (finding,) = check_lot(write(tmp_path, text), rounds=4)
    assert finding.level == "warning"
    assert "in 4 of 4 rounds (100.0%) there was no room for the fewest blocks" in finding.what


def test_a_start_that_cannot_be_as_far_from_the_slot_as_asked_is_an_error(tmp_path: Path) -> None:
    text = "distance = [35, 40]\n" + GATE.format(low=4, high=16)
    (finding,) = check_lot(write(tmp_path, text), rounds=4)
    assert finding.level == "error"
    # From x = 5 to 10 m to a slot at x = 30 m it is 20 to 25.5 m.
    assert re.search(
        r"in 4 of 4 .* for the start, first under the seed 0: it is 2\d\.\d\d m from", finding.what
    )


@pytest.mark.parametrize(("start", "distance"), [(5.4, 24.6), (6.4, 23.6), (0.7, 29.3)])
def test_a_start_exactly_as_far_from_the_slot_as_asked_is_good(
    start: float, distance: float, tmp_path: Path
) -> None:
    text = f"distance = [{distance}, 0]\n" + GATE.format(low=4, high=16)
    text = text.replace("[5, 10]", f"[{start}, {start}]").replace("[5, 15]", "[10, 10]")
    text = text.replace("[0, 40, 0, 20]", "[-5, 40, 0, 20]")
    assert check_lot(write(tmp_path, text), rounds=2) == []


def test_eight_vehicles_start_apart_before_the_gate_and_not_in_a_zone_of_one_place(
    tmp_path: Path,
) -> None:
    assert check_lot("gate", rounds=5, vehicles=8) == []
    text = GATE.format(low=4, high=16).replace("[5, 10]", "[8, 8]").replace("[5, 15]", "[9, 9]")
    path = write(tmp_path, text + "[[rows]]\nat = [30, 5]\nlength = 5.2\nwidth = 2.5\n")
    assert check_lot(path, rounds=5) == []
    (finding,) = check_lot(path, rounds=5, vehicles=2)
    assert (
        "for the start, first under the seed 0: it touches another at (8.00, 9.00) m"
        in finding.what
    )
    with pytest.raises(ScenarioError, match=r"3 vehicles on lot: it has 2 slots; two vehicles can"):
        check_lot(path, rounds=5, vehicles=3)


def test_two_vehicles_cannot_share_the_only_place_of_a_goal_zone(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"2 vehicles on face-to-face: it has 1 slot; two veh"):
        check_lot("face-to-face", rounds=1, vehicles=2)
    zones = ["x = [30, 30]\ny = [5, 5]", "x = [30, 30]\ny = [15, 15]"]
    start = GATE.format(low=4, high=16).split("[[rows]]")[0] + "slot = [5.2, 2.5]\n[[zones]]"
    start += GATE.split("[[zones]]")[1]
    path = write(tmp_path, start + "".join(f"[[zones]]\nrole = 'goal'\n{one}\n" for one in zones))
    assert check_lot(path, rounds=5, vehicles=2) == []
    with pytest.raises(ScenarioError, match=r"3 vehicles on lot: it has 2 slots; two vehicles can"):
        check_lot(path, rounds=5, vehicles=3)


def test_people_who_begin_in_a_wall_are_told(tmp_path: Path) -> None:
    people = "[[zones]]\nrole = 'people'\nx = [{0}, {1}]\ny = [12, 13]\n[people]\ncount = 2\n"
    text = "obstacles = [[24, 12, 0, 3, 4]]" + GATE.format(low=4, high=16).replace(
        "walls", "\nwalls"
    )
    (finding,) = check_lot(write(tmp_path, text + people.format(23, 25)), rounds=4)
    assert finding.level == "warning"
    assert finding.what == (
        "in 4 of 4 rounds (100.0%) no free place was found for a person, first under the "
        "seed 0: it touches the obstacle at (24.00, 12.00) m; make their zone larger"
    )
    # Where their zone is free in part, they begin there.
    assert check_lot(write(tmp_path, text + people.format(23, 29)), rounds=4) == []


def test_a_slot_that_is_good_for_its_vehicle_may_be_too_small_for_another(tmp_path: Path) -> None:
    (finding,) = check_lot("face-to-face", "car", rounds=1)
    assert finding.what.startswith("a slot of 3 by 2 m is too small for car")


def test_a_start_zone_that_bends_a_hitch_beyond_its_limit_is_an_error(tmp_path: Path) -> None:
    # The hitch of a car with a trailer bends by 60 degrees.
    text = GATE.format(low=4, high=16).replace("length = 5.2", "length = 12")
    bent = text.replace('role = "start"', 'role = "start"\nhitch = -80')
    (finding,) = check_lot(write(tmp_path, bent), "car-trailer", rounds=1)
    assert finding.what == (
        "a start zone with hitch = 80: car-trailer is jack-knifed beyond 60 degrees; give less, or "
        "choose another vehicle"
    )
    # A car alone has no hitch.
    assert check_lot(write(tmp_path, bent), rounds=1) == []
    path = write(tmp_path, bent.replace("-80", "60"))
    assert list(faults_of(load_lot(path), vehicle_named("car-trailer"))) == []


# Commands


def test_the_list_has_every_lot_with_its_figures() -> None:
    rows = json.loads(CliRunner().invoke(app, ["list", "--json"]).output)
    (kerb,) = (row for row in rows if row["name"] == "kerb")
    assert (kerb["size_m"], kerb["slots"], kerb["vehicle"]) == ([60.0, 9.3], 8, "car")
    assert "Bays along a kerb" in CliRunner().invoke(app, ["list"], env={"COLUMNS": "160"}).output


def test_a_check_says_what_is_wrong_and_ends_with_1(tmp_path: Path) -> None:
    good = CliRunner().invoke(app, ["check", "kerb", "--seeds", "2"])
    assert (good.exit_code, good.output) == (0, "kerb is good for car\n")
    bad = CliRunner().invoke(app, ["check", gate(tmp_path, 1.0), "--seeds", "2", "--json"])
    assert bad.exit_code == 1
    document = json.loads(bad.output)
    assert (document["lot"], document["vehicle"], document["ok"]) == ("lot", "car", False)
    assert document["findings"][0]["what"].startswith("no free way leads from a start to slot 0")


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_lot_is_drawn_with_a_round_in_it(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"yard.{suffix}"
    shown = CliRunner().invoke(app, ["show", "yard-70", "--seed", "3", "--to", str(path)])
    assert shown.exit_code == 0, shown.output
    assert path.read_bytes()[:4] in (b"\x89PNG", b"<?xm")
    assert path.stat().st_size > 10_000


def test_a_vehicle_too_large_for_the_slots_of_a_zone_makes_no_round_where_it_has_to_fit() -> None:
    with pytest.raises(ScenarioError, match=r"zone-30: a slot of 3 by 2 m is too small for car"):
        parking_scenario("zone-30", vehicle="car", level="parked")
    within_half_a_metre = parking_scenario("zone-30", vehicle="car", level="report-a-1")
    make_world(within_half_a_metre)


def test_a_round_whose_start_and_slot_lie_on_two_sides_of_a_wall_is_counted(tmp_path: Path) -> None:
    # Starts from x = 4 to 20 m, a wall without a gate at 12 m.
    text = f"walls = [[12, 0, 12, 20]]{ONE_BAY}".replace("[5, 10]", "[4, 20]")
    name = write(tmp_path, text)
    (finding,) = check_lot(name, rounds=20)
    assert finding.level == "error"
    parted = list(hopeless(name, range(20)))
    assert 0 < len(parted) < 20
    assert finding.what.startswith(
        f"in {len(parted)} of 20 rounds ({len(parted) / 20:.1%}) a vehicle cannot get to its slot, "
        f"first under the seed {parted[0]}: no free way leads from ("
    )


def test_the_inside_of_an_obstacle_is_no_place_to_start(tmp_path: Path) -> None:
    name = write(tmp_path, f"obstacles = [[7, 10, 0, 14, 16]]{ONE_BAY}")
    assert "lies in a wall: it has no place" in check_lot(name, rounds=10)[0].what


def test_outside_of_the_area_and_at_its_border_there_is_no_region(tmp_path: Path) -> None:
    ways = Ways(load_lot(gate(tmp_path, 3.0)), CAR)
    for x, y in ((-500.0, 10.0), (500.0, 10.0), (20.0, 1e4), (0.0, 0.0), (40.0, 20.0)):
        assert ways.regions((x, x), (y, y)) == set()


def test_coarse_cells_close_no_gap_that_a_small_car_passes(tmp_path: Path) -> None:
    """Of a yard of 500 m cells are 0.35 m, and a TT-02 is 0.19 m wide."""
    for gap in np.arange(0.3, 0.6, 0.1).tolist():
        walls = f"obstacles = [[250, 100, 0, 2, 200], [250, {350 + gap}, 0, 2, 300]]"
        text = f"area = [0, 500, 0, 500]\nvehicle = 'tt02'\n{walls}\n"
        text += "[[rows]]\nat = [400, 250]\nlength = 2\nwidth = 1\n"
        text += "[[zones]]\nrole = 'start'\nx = [100, 100]\ny = [250, 250]\n"
        assert parted_in(write(tmp_path, text), vehicle_named("tt02")) == []


def test_a_goal_that_touches_a_wall_in_each_round_is_hopeless(tmp_path: Path) -> None:
    text = GATE.format(low=4, high=16) + "[[zones]]\nrole = 'goal'\nx = [39, 39]\ny = [10, 10]\n"
    text = text.replace("[[rows]]\nat = [30, 10]\nlength = 5.2\nwidth = 2.5\n", "slot = [5, 2.5]\n")
    assert list(hopeless(write(tmp_path, text), range(4))) == [0, 1, 2, 3]


def test_a_slot_behind_a_wall_is_told_where_vehicles_start_in_slots(tmp_path: Path) -> None:
    rows = "[[rows]]\nat = [5, 10]\ntowards = 0\ncount = 2\npitch = 6\nlength = 6\nwidth = 4\n"
    alone = "[[rows]]\nat = [35, 10]\nlength = 6\nwidth = 4\n"
    area = "area = [0, 40, 0, 20]\nvehicle = 'car'\nfrom_slots = true\n"
    assert cut_off(Ways(load_text(tmp_path, area + rows + alone), CAR)) == []
    wall = "walls = [[25, 0, 25, 20]]\n"
    (found,) = cut_off(Ways(load_text(tmp_path, area + wall + rows + alone), CAR))
    assert found.startswith("no free way leads from a start to slot 2 at (35.00, 10.00) m")
