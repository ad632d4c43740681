"""Numbers of a lot that no vehicle can park with, and those at their edges."""

import math
from pathlib import Path

import pytest

from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import LotError, ScenarioError
from race_server.scenario.lot.check import check_lot
from race_server.scenario.lot.ways import Ways, cut_off
from race_server.scenario.parking import parking_scenario
from race_server.scenario.track.lot import Lot
from support.lots import ONE_BAY, load_text

BASE = f"{ONE_BAY}[taken]\nshare = 0.5\n"


def lot_of(tmp_path: Path, before: str, behind: str = "") -> Lot:
    lot = load_text(tmp_path, f"{before}\n{BASE}{behind}\n").lot
    assert lot is not None
    return lot


@pytest.mark.parametrize(
    ("behind", "size"), [("width = 19", "4.7 by 19"), ("length = 47", "47 by 1.9")]
)
def test_what_is_parked_must_not_reach_out_of_its_slot(
    behind: str, size: str, tmp_path: Path
) -> None:
    with pytest.raises(LotError) as told:
        lot_of(tmp_path, "", behind)
    assert str(told.value) == (
        f"lot.toml: [taken] of {size} m: slots are from 5.2 by 2.5 m on, and what is parked in one "
        "must not reach out of it; make it smaller, or the slots larger"
    )


def test_what_is_parked_may_fill_its_slot(tmp_path: Path) -> None:
    assert lot_of(tmp_path, "", "length = 5.2\nwidth = 2.5").taken.width == 2.5


def test_where_nothing_is_parked_its_size_does_not_matter(tmp_path: Path) -> None:
    assert load_text(tmp_path, BASE.replace("share = 0.5", "width = 19")).digest


@pytest.mark.parametrize("pair", ["[50, 10]", "[10, 10]", "[-10, 50]", "[-10, 0]", "[0, -5]"])
def test_a_distance_rises_from_zero_or_more(pair: str, tmp_path: Path) -> None:
    with pytest.raises(LotError, match=r"distance = .*: give nearest and farthest, the second lar"):
        lot_of(tmp_path, f"distance = {pair}")


@pytest.mark.parametrize("pair", [(0.0, 0.0), (5.0, 0.0), (0.0, 32.0), (10.0, 50.0)])
def test_zero_sets_no_limit_to_a_distance(pair: tuple[float, float], tmp_path: Path) -> None:
    assert lot_of(tmp_path, f"distance = {list(pair)}").distance == pair


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (f"limit_s = {'9' * 400}", "limit_s = 9{60}: give a number from 1 to 3600"),
        (f"limit_s = -{'9' * 400}", "limit_s = -9{59}: give a number from 1 to 3600"),
        (f"slot = [{'9' * 400}, 2]", "slot = .*: give 2 numbers, each up to 100000"),
        # Python writes no integer of more than 4300 digits, and reads one in hexadecimal.
        (f"limit_s = 0x{'f' * 9000}", "limit_s = an integer of thousands of digits: give a"),
        (f"slot = [0x{'f' * 9000}, 2]", "slot = an integer of thousands of digits: give 2"),
    ],
)
def test_an_integer_of_hundreds_of_digits_is_refused_in_one_sentence(
    line: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(LotError, match=message) as told:
        lot_of(tmp_path, line)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("count", ["[0.5, 1.5]", "[1, 2.5]", "[0, 65]", "[3, 1]"])
def test_blocks_are_counted_in_whole_numbers(count: str, tmp_path: Path) -> None:
    with pytest.raises(
        LotError, match=r"count = .*: give fewest and most, whole numbers from 0 to"
    ):
        lot_of(tmp_path, "", f"[blocks]\ncount = {count}")


@pytest.mark.parametrize("limit_s", [-5.0, 1e-9, 0.99, 3600.1, math.nan, math.inf])
def test_a_time_limit_is_refused_that_no_lot_may_have(limit_s: float) -> None:
    with pytest.raises(ScenarioError) as told:
        parking_scenario("gate", limit_s=limit_s)
    assert str(told.value) == (
        f"time limit {limit_s:g} s: choose 1 to 3600 s, or 0 for that of the lot"
    )


@pytest.mark.parametrize("goal", ["[60, 65]", "[30, 34]"])
def test_a_start_from_where_a_vehicle_has_left_at_once_is_an_error(
    goal: str, tmp_path: Path
) -> None:
    """From x = 5 to 10 m it is 50 m or more to the one, and less than 30 to the other."""
    text = "area = [0, 70, 0, 20]\nlevel = 'report-a-1'\n[[zones]]\nrole = 'start'\nx = [5, 10]\n"
    text += f"y = [10, 10]\n[[zones]]\nrole = 'goal'\nx = {goal}\ny = [10, 10]\n"
    load_text(tmp_path, text)
    found = check_lot(str(tmp_path / "lot.toml"), rounds=4)
    assert [one.level for one in found] == ["error"] * (goal == "[60, 65]")
    for one in found:
        assert "m from its slot, and by the level report-a-1 a vehicle beyond 30 m has" in one.what


def ways_past(tmp_path: Path, *walls: list[float]) -> list[str]:
    """Return what walls cut off from a car of 0.19 m, in 200 m by 200 m: cells are 0.14 m."""
    text = f"area = [0, 200, 0, 200]\nvehicle = 'tt02'\nwalls = {[*walls]}\n"
    text += "[[rows]]\nat = [150, 100]\nlength = 2\nwidth = 1\n"
    text += "[[zones]]\nrole = 'start'\nx = [50, 50]\ny = [100, 100]\n"
    return cut_off(Ways(load_text(tmp_path, text), vehicle_named("tt02")))


@pytest.mark.parametrize("lean", [0.0, 30.0, 90.0])
def test_a_thin_wall_closes_a_large_area_to_a_narrow_car(lean: float, tmp_path: Path) -> None:
    (found,) = ways_past(tmp_path, [100 - lean, 0, 100 + lean, 200])
    assert found.startswith("no free way leads from a start to slot 0")


@pytest.mark.parametrize("y", [99.9, 99.95, 100.0])
def test_a_gap_of_20_cm_in_a_thin_wall_lets_a_car_of_19_cm_through(
    y: float, tmp_path: Path
) -> None:
    # A wall has 0.05 m more at each end.
    assert ways_past(tmp_path, [100, 0, 100, y], [100, y + 0.3, 100, 200]) == []


@pytest.mark.parametrize(("limit_s", "taken"), [(0.0, 180.0), (1.0, 1.0), (3600.0, 3600.0)])
def test_a_time_limit_of_zero_is_that_of_the_lot(limit_s: float, taken: float) -> None:
    assert parking_scenario("gate", limit_s=limit_s).rules.limit_s == taken
