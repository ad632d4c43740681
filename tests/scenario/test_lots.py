"""Files of car parks: those that are shipped, those drawn by a seed, and those that are wrong."""

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.core.vehicle_presets import CAR, KART_13, LORRY, vehicle_named
from race_server.core.vehicles import GRAVITY
from race_server.errors import LotError, ScenarioError
from race_server.scenario.level import LEVELS
from race_server.scenario.lot.faults import slots_of
from race_server.scenario.lot.footprint import Footprint, wall_under
from race_server.scenario.lot.generated import generated_file
from race_server.scenario.lot.load import load_lot, lot_names, summary
from race_server.scenario.lot.site import polygons_in
from race_server.scenario.lot.ways import Ways, cut_off
from race_server.scenario.places import own_folder
from race_server.scenario.track.course import Course
from race_server.scenario.track.lot import Lot
from race_server.scenario.track.polyline import is_inside
from race_server.scenario.track.walls import fence_of
from support.lots import ONE_BAY, load_text


def lot_of(course: Course) -> Lot:
    assert course.lot is not None
    return course.lot


# Shipped lots


def test_the_lots_are_shipped() -> None:
    rows = "aisle-45 aisle-60 aisle-90 bays-yard dock-35 face-to-face gate grid-150 kart-park kerb"
    yards = ["parking-v0", "yard-70", "yard-70-busy", "yard-70-east", "yard-end"]
    assert lot_names() == [*rows.split(), *yards, "zone-30", "zone-30-east"]


@pytest.mark.parametrize("name", lot_names())
def test_a_free_way_leads_to_every_slot_of_a_shipped_lot(name: str) -> None:
    course = load_lot(name)
    vehicle = vehicle_named(lot_of(course).vehicle)
    assert cut_off(Ways(course, vehicle)) == []


@pytest.mark.parametrize(
    ("name", "width"), [("aisle-90", 6.0), ("aisle-60", 4.0), ("aisle-45", 3.5)]
)
def test_between_the_rows_lies_an_aisle_of_its_width(name: str, width: float) -> None:
    slots = slots_of(load_lot(name))
    assert len(slots) == 32
    south = max(slot.corners[:, 1].max() for slot in slots if slot.y < 0.0)
    north = min(slot.corners[:, 1].min() for slot in slots if slot.y > 0.0)
    assert north - south == pytest.approx(width, abs=0.02)


def test_bays_along_the_kerb_are_shorter_and_longer_than_one_move_needs() -> None:
    front, rear = CAR.wheelbase + 0.96, 0.929
    needed = rear + math.sqrt(front**2 + 2.0 * CAR.turning_radius * CAR.width)
    assert needed == pytest.approx(6.01, abs=0.005)
    lengths = [slot.length for slot in slots_of(load_lot("kerb"))]
    assert lengths == [5.3, 5.5, 5.7, 5.9, 6.0, 6.1, 6.3, 6.5]
    assert sum(length < needed for length in lengths) == 5


def test_the_gate_is_3_50_m_wide_between_its_walls() -> None:
    course = load_lot("gate")
    low, high = sorted(course.obstacles, key=lambda wall: wall.y)
    assert (high.y - 0.5 * high.length) - (low.y + 0.5 * low.length) == pytest.approx(3.5)


def test_in_grid_150_four_rows_of_27_slots_lie_on_aisles_of_24_m_and_more() -> None:
    course = load_lot("grid-150")
    rows = sorted({slot.y for slot in slots_of(course)})
    assert len(slots_of(course)) == 108
    # Slots of 18 m: their ends lie 9 m from their middles.
    low, *_, high = rows
    assert rows[2] - rows[1] - 18.0 == pytest.approx(24.0)
    assert (low - 9.0, 150.0 - high - 9.0) == pytest.approx((26.6, 26.6))
    for slot in slots_of(course):
        # Each points to its aisle: away from the wall behind it, which is 9.2 m from its middle.
        wall = min((44.8, 105.2), key=lambda y, at=slot.y: abs(y - at))
        assert abs(wall - slot.y) == pytest.approx(9.2)
        assert math.copysign(1.0, slot.y - wall) == pytest.approx(math.sin(slot.heading))


def test_the_yard_of_dock_35_is_twice_the_lorry_and_2_m_deep() -> None:
    course = load_lot("dock-35")
    slots = slots_of(course)
    assert len(slots) == 18
    assert slots[1].x - slots[0].x == pytest.approx(4.0)
    depth = float(np.ptp(course.borders[:4, 1]))
    assert depth == pytest.approx(2.0 * LORRY.overall_length + 2.0)


def test_the_car_is_that_of_the_benchmark() -> None:
    assert CAR.length == pytest.approx(2.80 + 0.96 + 0.929)
    assert CAR.turning_radius == pytest.approx(3.006, abs=1e-3)
    # The front bumper is 3.76 m ahead of the rear axle.
    front = CAR.rear_axle + CAR.box_offset + 0.5 * CAR.length
    assert front == pytest.approx(2.80 + 0.96)
    resistance = CAR.rolling * GRAVITY
    assert CAR.motor_force / CAR.mass - resistance == pytest.approx(1.0)
    assert CAR.brake_force / CAR.mass + resistance == pytest.approx(1.0)


def test_a_summary_has_the_figures_of_a_lot() -> None:
    figures = summary(load_lot("yard-70"))
    assert (figures["size_m"], figures["slots"], figures["people"]) == ([80.0, 30.0], 0, 1)
    assert (figures["vehicle"], figures["blocks"]) == ("kart-13", [6, 10])


# Lots drawn by a seed


@pytest.mark.parametrize("kind", ["yard", "aisle", "kerb", "street"])
def test_forty_generated_lots_can_be_parked_in(kind: str) -> None:
    courses = [load_lot(f"generated:{kind}:{seed}") for seed in range(40)]
    assert len({course.digest for course in courses}) == 40
    for course in courses[:5]:
        vehicle = KART_13 if kind == "yard" else CAR
        assert cut_off(Ways(course, vehicle)) == [], course.name


def test_generated_aisles_have_all_angles() -> None:
    courses = [load_lot(f"generated:aisle:{seed}") for seed in range(30)]
    turns = {abs(round(math.degrees(lot_of(course).slots[-1, 2]))) for course in courses}
    assert turns == {45, 60, 90, 270}


def test_slots_of_generated_kerbs_follow_one_another() -> None:
    for seed in range(10):
        x, _, _, lengths, _ = lot_of(load_lot(f"generated:kerb:{seed}")).slots.T
        assert np.diff(x) == pytest.approx(0.5 * (lengths[1:] + lengths[:-1]), abs=2e-3)
        assert lengths.min() >= 5.3
        assert lot_of(load_lot(f"generated:street:{seed}")).slots[:, 3] == pytest.approx(5.86)


def test_a_seed_gives_the_same_lot_always() -> None:
    name = "generated:yard:17"
    assert generated_file(name) == generated_file.__wrapped__(name)
    assert load_lot(name).digest != load_lot("generated:yard:18").digest


@pytest.mark.parametrize("name", ["generated:lot:1", "generated:yard:-1", "generated:yard:x"])
def test_another_name_is_told_what_can_be_generated(name: str) -> None:
    with pytest.raises(LotError, match=r"cannot be generated; write generated:yard:SEED, gen"):
        load_lot(name)


# Polygons


def test_the_free_side_of_a_polygon_is_on_the_left_of_each_of_its_sides(tmp_path: Path) -> None:
    corners = "[[15, 5], [20, 5], [20, 8], [16, 9]]"
    there = load_text(tmp_path, f"polygons = [{corners}]\n{ONE_BAY}")
    back = load_text(
        tmp_path, f"polygons = [{corners[:1]}[16, 9], [20, 8], [20, 5], [15, 5]]]\n{ONE_BAY}"
    )
    for course in (there, back):
        (polygon,) = polygons_in(course)
        assert len(polygon) == 4
        x0, y0, x1, y1 = polygon.T
        along = np.stack([x1 - x0, y1 - y0], axis=1)
        left = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
        middle = 0.5 * (polygon[:, :2] + polygon[:, 2:])
        assert not is_inside(middle + 0.01 * left, polygon).any()
        assert is_inside(middle - 0.01 * left, polygon).all()
        assert len(fence_of(course).segments) == 8


def test_a_polygon_in_the_corner_of_the_area_leaves_the_area_as_it_is(tmp_path: Path) -> None:
    course = load_text(
        tmp_path, f"polygons = [[[0, 0], [0, -9], [-9, 0]], [[0, 0], [4, 0], [0, 4]]]\n{ONE_BAY}"
    )
    assert summary(course)["size_m"] == [40.0, 20.0]
    assert cut_off(Ways(course, CAR)) == []


@pytest.mark.parametrize(
    ("key", "near", "far"),
    [
        ("obstacles", "89, 69, 45, 1, 1", "20000, 10, 0, 1, 1"),
        ("obstacles", "20, -10, 0, 130, 1", "20, -10, 0, 150, 1"),
        ("walls", "0, 0, 90, 70", "0, 0, 20000, 10"),
    ],
)
def test_what_stands_fixed_stays_within_50_m_of_the_area(
    key: str, near: str, far: str, tmp_path: Path
) -> None:
    # The area is 40 m by 20 m.
    assert len(load_text(tmp_path, f"{key} = [[{near}]]\n{ONE_BAY}").obstacles) == 1
    with pytest.raises(LotError, match=rf"{key}\[1\] = .*: stay within 50 m of the area"):
        load_text(tmp_path, f"{key} = [[{far}]]\n{ONE_BAY}")


# The manual


def example_of_the_manual() -> tuple[str, str]:
    """Return the manual, and the example in it."""
    manual = (own_folder("lots") / "README.md").read_text(encoding="utf-8")
    return manual, manual.split("```text\n")[1].split("```")[0]


def test_the_example_of_the_manual_has_every_key_that_it_describes(tmp_path: Path) -> None:
    manual, example = example_of_the_manual()
    lot = lot_of(load_text(tmp_path, example))
    assert (len(lot.slots), lot.people.count, lot.blocks.count) == (6, 2, (1, 3))
    cells = [row.split("|")[1] for row in manual.splitlines() if row.startswith("| `")]
    described = {word for cell in cells for word in re.findall(r"`\[*([\w.]+)", cell)}
    words = tomllib.loads(example)
    keys = {*words}
    for name in ("rows", "zones"):
        keys |= {*words[name][0]}
    for name in ("taken", "blocks", "people"):
        keys |= {f"{name}.{key}" for key in words[name]}
    assert described == keys


def test_the_page_on_parking_has_a_row_for_every_lot_and_every_level() -> None:
    page = (own_folder("docs") / "parking.md").read_text(encoding="utf-8")
    tables = page.partition("## What a round draws")[0]
    rows = [row.split("|")[1] for row in tables.splitlines() if row.startswith("| `")]
    assert set(re.findall(r"`([\w-]+)`", " ".join(rows))) == {*lot_names(), *LEVELS}


@pytest.mark.parametrize("number", ["0", "-1", "1e9", "-1e300", "nan", "inf", "true", "'x'", "[]"])
def test_any_number_in_place_of_another_makes_a_lot_or_one_sentence(
    number: str, tmp_path: Path
) -> None:
    _, example = example_of_the_manual()
    refused = []
    places = list(re.finditer(r"(?<=[\[ ])-?\d+(\.\d+)?(?=[\],\n])", example))
    assert len(places) > 50
    for place in places:
        try:
            load_text(tmp_path, example[: place.start()] + number + example[place.end() :])
        except LotError as error:
            refused.append(str(error))
    assert len(refused) > 3
    assert "\n" not in "".join(refused)


def test_a_lot_may_be_given_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "bay.toml"
    path.write_text(ONE_BAY)
    assert load_lot(path) is load_lot(str(path))
    with pytest.raises(LotError, match=r"lot '3' is unknown; choose one of aisle-45"):
        load_lot(3)  # type: ignore[arg-type]


def test_the_seed_of_a_generated_lot_has_one_way_to_be_written() -> None:
    # Full-width digits, and a zero before: other names for the lot that was held out.
    for seed in ("\uff11\uff17", "017"):
        with pytest.raises(LotError, match=r"cannot be generated; write generated:yard:SEED"):
            load_lot(f"generated:yard:{seed}")
    assert load_lot("generated:yard:0").name == "generated:yard:0"


def test_an_unknown_lot_names_those_that_exist() -> None:
    with pytest.raises(LotError, match=r"lot 'garage' is unknown; choose one of aisle-45, .*gener"):
        load_lot("garage")


def test_a_name_that_is_too_long_for_a_file_is_an_unknown_lot() -> None:
    with pytest.raises(LotError, match=r"lot 'a{300}' is unknown; choose one of aisle-45"):
        load_lot("a" * 300)


def test_polygons_that_begin_in_one_corner_are_obstacles_each(tmp_path: Path) -> None:
    square = "[[2, 2], [2, 6], [6, 6], [6, 2]]"
    course = load_text(tmp_path, f"polygons = [{square}, {square}]\n{ONE_BAY}")
    assert summary(course)["polygons"] == 2
    # In both of them, and away from all sides.
    inside = wall_under(course, Footprint(4.0, 4.0, 0.0, 1.0, 1.0))
    assert inside.startswith("the polygon with a corner at")


def test_a_polygon_that_touches_itself_in_its_first_corner_keeps_its_hole(tmp_path: Path) -> None:
    outside, hole = "[2, 2], [2, 8], [8, 8], [8, 2]", "[2, 2], [6, 3], [6, 6], [3, 6]"
    course = load_text(tmp_path, f"polygons = [[{outside}, {hole}]]\n{ONE_BAY}")
    assert summary(course)["polygons"] == 1
    assert wall_under(course, Footprint(4.5, 4.5, 0.0, 0.5, 0.5)) == ""
    assert wall_under(course, Footprint(7.0, 7.0, 0.0, 0.5, 0.5)) != ""


def test_own_lots_are_found_in_the_folders_of_a_variable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.toml").write_text(ONE_BAY)
    monkeypatch.setenv("RACE_LOTS", str(tmp_path))
    assert load_lot("mine").title == "mine"
    assert "mine" in lot_names()


def test_a_folder_of_lots_that_does_not_exist_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RACE_LOTS", "/nowhere")
    with pytest.raises(ScenarioError, match=r"RACE_LOTS: /nowhere is no folder; make it, or name"):
        lot_names()


def test_a_title_has_one_line(tmp_path: Path) -> None:
    (tmp_path / "lot.toml").write_text('title = "two\\n lines"\n' + ONE_BAY)
    assert load_lot(tmp_path / "lot.toml").title == "two lines"


def test_without_a_title_a_lot_has_the_beginning_of_its_files_name(tmp_path: Path) -> None:
    path = tmp_path / f"{'long' * 20}.toml"
    path.write_text(ONE_BAY)
    assert load_lot(path).title == "long" * 16


def test_a_file_whose_name_is_not_utf_8_is_told_and_the_list_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "park\udcff.toml").write_text(ONE_BAY)
    with pytest.raises(LotError, match="a course has its file's name in UTF-8; rename it"):
        load_lot(tmp_path / "park\udcff.toml")
    monkeypatch.setenv("RACE_LOTS", str(tmp_path))
    shown = CliRunner().invoke(app, ["lot", "list"])
    assert shown.exit_code == 0, shown.output
    assert "yard-70" in shown.output
