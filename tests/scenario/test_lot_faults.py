"""Files of car parks that are wrong: one sentence for each fault."""

from pathlib import Path

import pytest

from race_server.errors import LotError
from race_server.scenario.lot.load import load_lot
from support.lots import ONE_BAY, load_text

FAULTS = {
    "vehicle = 'lorry'": (r"vehicle 'lorry' is unknown", ONE_BAY.replace('"car"', '"lorry"')),
    "slot too small": (
        r"a slot of 4.5 by 2.5 m is too small for car, which is 4.689 by 1.942 m; make it larger",
        ONE_BAY.replace("5.2", "4.5"),
    ),
    "slot without room": (
        r"a slot of 4.689 by 2.5 m is too small for car, .* make it larger by 0.05 m or more",
        ONE_BAY.replace("5.2", "4.689"),
    ),
    "zone from right to left": (
        r"zones\[2\]: x = \[31.0, 30.0\]: give the smaller one first",
        ONE_BAY + "[[zones]]\nrole = 'goal'\nx = [31, 30]\n",
    ),
    "slot under a wall": (
        r"slot 0 at \(30.00, 10.00\) m lies under the obstacle at \(30.00, 11.00\) m; move one",
        f"walls = [[25, 11, 35, 11]]\n{ONE_BAY}",
    ),
    "slot inside an obstacle": (
        r"slot 0 at \(30.00, 10.00\) m lies under the obstacle at \(30.00, 10.00\) m; move one",
        f"obstacles = [[30, 10, 0, 9, 9]]\n{ONE_BAY}",
    ),
    "slot under a polygon": (
        r"slot 0 at .* lies under the polygon with a corner at \(30.00, 14.00\) m; move one",
        f"polygons = [[[30, 10], [34, 10], [30, 14]]]\n{ONE_BAY}",
    ),
    "slot outside": (
        r"slot 0 at \(38.00, 10.00\) m reaches out of the area; move its row",
        ONE_BAY.replace("[30, 10]", "[38, 10]"),
    ),
    "two vehicles with one slot": (
        r"slots 0 and 1 overlap near \(30.00, 11.00\) m: two vehicles with one place; move a row",
        ONE_BAY + "[[rows]]\nat = [30, 11]\nlength = 5.2\nwidth = 2.5\n",
    ),
    "pitch less than width": (
        r"slots 0 and 1 overlap near",
        ONE_BAY.replace("width = 2.5", "width = 2.5\ncount = 2\npitch = 2.2\ntowards = 90"),
    ),
    "goal zone outside": (
        r"zones\[2\]: x = \[30.0, 41.0\]: stay within the area, 0 to 40",
        ONE_BAY + "[[zones]]\nrole = 'goal'\nx = [30, 41]\n",
    ),
    "no start": (
        r"no start: give a zone with role = 'start'",
        ONE_BAY.replace('"start"', '"people"'),
    ),
    "goals beside slots": (
        r"a zone with role = 'goal' beside \[\[rows\]\]: the slots are the goals",
        ONE_BAY + "[[zones]]\nrole = 'goal'\nx = [25, 35]\n",
    ),
    "a wall of no length": (
        r"walls\[1\] = \[20.0, 10.0, 20.0, 10.0\]: both ends are one point",
        f"walls = [[20, 10, 20, 10]]\n{ONE_BAY}",
    ),
    "no slot": (
        r"no slot: give \[\[rows\]\] of slots or a zone with role = 'goal'",
        "area = [0, 40, 0, 20]\n[[zones]]\nrole = 'start'\n",
    ),
    "blocks without a zone": (
        r"\[blocks\] count = 3: give a zone with role = 'blocks'",
        ONE_BAY + "[blocks]\ncount = [1, 3]\n",
    ),
    "people without a zone": (
        r"\[people\] count = 2: give a zone with role = 'people'",
        ONE_BAY + "[people]\ncount = 2\n",
    ),
    "misspelt": (r"colour = 'red': no such key; see lots/README.md", f"colour = 'red'\n{ONE_BAY}"),
    "no area": (r"area is missing: give x0", ONE_BAY.replace("area =", "title = 'x' #")),
    "occupied slots without slots": (
        r"\[taken\] share = 0.5 without \[\[rows\]\]: give rows, or leave it out",
        "area = [0, 40, 0, 20]\n[[zones]]\nrole = 'start'\n[[zones]]\nrole = 'goal'\n"
        "[taken]\nshare = 0.5\n",
    ),
    "starts in slots and in a zone": (
        r"a zone with role = 'start' beside from_slots = true: leave one of the two out",
        f"from_slots = true\n{ONE_BAY}[[rows]]\nat = [30, 15]\nlength = 5.2\nwidth = 2.5\n",
    ),
    "area far away": (
        r"area = \[980.0, 1020.0, 0.0, 20.0\]: stay within 1000 m of the origin",
        ONE_BAY.replace("[0, 40, 0, 20]", "[980, 1020, 0, 20]"),
    ),
    "large area": (
        r"area = .*: give x0, x1, y0, y1 with sides of 1 to 500 m",
        ONE_BAY.replace("40, 0, 20", "400, 0, 2000"),
    ),
    "polygon of two lobes of one size": (
        r"polygons\[1\] = .*: its sides cross; give its corners in order",
        f"polygons = [[[20, 2], [24, 6], [24, 2], [20, 6]]]\n{ONE_BAY}",
    ),
    "polygon of two points": (
        r"polygons\[1\] = .*: give 3 to 64 points \[x, y\]",
        f"polygons = [[[1, 2], [3, 4]]]\n{ONE_BAY}",
    ),
    "polygon on a line": (
        r"polygons\[1\] = .*: its corners lie on one line; give an area, or a wall",
        f"polygons = [[[1, 2], [3, 4], [5, 6]]]\n{ONE_BAY}",
    ),
    "polygon that crosses itself": (
        r"polygons\[1\] = .*: its sides cross; give its corners in order",
        f"polygons = [[[15, 1], [20, 3], [20, 1], [15, 4]]]\n{ONE_BAY}",
    ),
    "polygon far away": (
        r"polygons\[1\] = .*: stay within 50 m of the area",
        f"polygons = [[[15, 1], [20, 1], [20, 99]]]\n{ONE_BAY}",
    ),
    "polygon of words": (
        r"polygons\[1\]\[2\] = 'x': give 2 numbers",
        f"polygons = [[[15, 1], 'x', [20, 4]]]\n{ONE_BAY}",
    ),
    "no TOML": (r"no TOML", "area = ["),
    "level": (r"level = 'loose': choose one of report-a-1", f"level = 'loose'\n{ONE_BAY}"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_wrong_with_a_lot_is_one_sentence(fault: str, tmp_path: Path) -> None:
    sentence, text = FAULTS[fault]
    with pytest.raises(LotError, match=r"^lot.toml.*" + sentence) as told:
        load_text(tmp_path, text)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("name", ["\0.toml", "\ud800.toml", "a/\0.toml"])
def test_a_name_that_no_file_can_have_is_one_sentence(name: str) -> None:
    with pytest.raises(LotError, match="no file can have this name; give another one"):
        load_lot(name)


def test_the_lot_that_they_differ_from_is_good(tmp_path: Path) -> None:
    assert load_text(tmp_path, ONE_BAY).lot is not None
