"""Courses imported from occupancy maps that these tests draw."""

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from race_server.core import codes
from race_server.core.kernels.course import nearest_sample_anywhere, progress_of
from race_server.core.stages.progress import follow_course
from race_server.core.vehicle_presets import KART_60, TT02
from race_server.errors import TrackError
from race_server.scenario.race import Scenario, make_world
from race_server.scenario.track.check import check_course
from race_server.scenario.track.course import Course
from race_server.scenario.track.importers import Imported, import_course, map_beside
from race_server.scenario.track.load import load_course
from race_server.scenario.track.occupancy_map import read_map
from race_server.scenario.track.pixel_parts import parts_of

STEP = 0.1  # [m] of a pixel
Drawing = Callable[[Any, Any], Any]  # from x, y [m] to whether it is free


def draw(folder: Path, is_free: Drawing, step: float = STEP) -> Path:
    """Write a map of 30 m by 30 m around the origin; `step` counts as the size of a pixel [m]."""
    column, row = np.meshgrid(np.arange(300), np.arange(300))
    free = is_free(STEP * (column - 149.5), STEP * (149.5 - row))
    Image.fromarray(np.where(free, 255, 0).astype(np.uint8)).save(folder / "drawn.png")
    path = folder / "drawn.yaml"
    path.write_text(
        f"image: drawn.png\nresolution: {step}\norigin: [{-150 * step}, {-150 * step}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return path


def ring(x: Any, y: Any) -> Any:
    """A ring of radius 10 m, 4 m wide."""
    return np.abs(np.hypot(x, y) - 10.0) < 2.0


def hairpin(x: Any, y: Any) -> Any:
    """All that is less than 2 m from a wall of 10 m which is as thin as a pixel."""
    off = np.hypot(np.maximum(np.abs(x) - 5.0, 0.0), y)
    return (off < 2.0) & ~((np.abs(y - 0.05) < 0.05) & (np.abs(x) < 5.0))


def imported(folder: Path, is_free: Drawing, **options: Any) -> Imported:
    path = draw(folder, is_free, options.pop("step", STEP))
    return import_course(path, folder / "course.toml", title="Drawn", **options)


def errors_of(course: Course, folder: Path, vehicle: Any = TT02) -> list[str]:
    beside = map_beside(folder / "course.toml")
    assert beside is not None
    return [
        finding.what
        for finding in check_course(course, vehicle, read_map(beside))
        if finding.level == "error"
    ]


def test_a_ring_is_as_long_and_as_wide_as_it_was_drawn(tmp_path: Path) -> None:
    course = imported(tmp_path, ring).course
    assert course.length == pytest.approx(20.0 * np.pi, rel=0.01)
    assert course.width_mean == pytest.approx(4.0, abs=0.05)
    assert np.abs(course.line[:, :2].mean(axis=0)).max() < 0.05
    assert errors_of(course, tmp_path) == []


def test_the_start_lies_on_the_longest_straight_with_the_grid_behind_it(tmp_path: Path) -> None:
    def stadium(x: Any, y: Any) -> Any:
        return np.abs(np.hypot(np.maximum(np.abs(x) - 8.0, 0.0), y) - 4.0) < 1.5

    course = imported(tmp_path, stadium, scale="1/10").course
    x, y, heading, curvature = course.line[0]
    assert abs(y) == pytest.approx(4.0, abs=0.1)
    assert abs(curvature) < 0.02
    # Of a lap of 57 m the 6.9 m behind it and the 2.3 m ahead lie on a straight of 16 m.
    assert -8.1 + 6.9 < np.sign(np.cos(heading)) * x < 8.1 - 2.3
    assert np.abs(course.grid[:8, 1]).min() > 3.0


def test_the_line_leads_around_the_tip_of_a_wall_as_thin_as_a_pixel(tmp_path: Path) -> None:
    course = imported(tmp_path, hairpin).course
    # Two straights of 10 m, and two half circles at 1 m from the wall's ends.
    assert course.length == pytest.approx(20.0 + 2.0 * np.pi, rel=0.01)
    assert errors_of(course, tmp_path) == []


def test_the_line_passes_an_obstacle_on_the_wider_side(tmp_path: Path) -> None:
    def is_free(x: Any, y: Any) -> Any:
        return ring(x, y) & ~(np.hypot(x - 11.0, y) < 0.3)

    course = imported(tmp_path, is_free).course
    beside = course.line[np.argmin(np.hypot(course.line[:, 0] - 10.0, course.line[:, 1])), 0]
    # Midway between the inner wall at 8 m and the obstacle at 10.7 m, a little smoothed.
    assert beside == pytest.approx(9.35, abs=0.15)
    assert read_map(tmp_path / "drawn.yaml").is_free(course.line[:, :2]).all()


def test_walls_drawn_as_lines_on_white_paper_make_the_same_course(tmp_path: Path) -> None:
    def is_free(x: Any, y: Any) -> Any:
        radius = np.hypot(x, y)
        return (np.abs(radius - 7.9) > 0.1) & (np.abs(radius - 12.1) > 0.1)

    course = imported(tmp_path, is_free).course
    assert course.length == pytest.approx(20.0 * np.pi, rel=0.01)


def test_a_course_leads_around_its_infield_and_not_around_a_house_in_it(tmp_path: Path) -> None:
    def is_free(x: Any, y: Any) -> Any:
        is_wall = np.abs(np.abs(np.hypot(x, y) - 10.0) - 1.1) < 0.1
        return ~is_wall & (np.maximum(np.abs(x), np.abs(y)) > 1.0)

    course = imported(tmp_path, is_free).course
    assert course.length == pytest.approx(20.0 * np.pi, rel=0.01)
    assert course.width_mean == pytest.approx(2.0, abs=0.1)


def test_an_import_says_that_a_map_has_more_loops_than_a_course(tmp_path: Path) -> None:
    def eight(x: Any, y: Any) -> Any:
        return np.abs(np.hypot(x, np.abs(y) - 5.0) - 5.0) < 1.0

    assert imported(tmp_path, eight).remark.startswith("the map has 2 islands that may each")
    assert imported(tmp_path, ring).remark == ""

    def two(x: Any, y: Any) -> Any:
        return np.abs(np.hypot(np.abs(x) - 7.0, y) - 5.0) < 1.0

    assert imported(tmp_path, two).remark.startswith("the map has 2 corridors that are closed")
    assert imported(tmp_path, lambda x, y: ring(x, y) & (np.hypot(x - 10.0, y) > 0.5)).remark == ""


def test_an_import_says_where_the_picture_and_not_a_wall_is_the_border(tmp_path: Path) -> None:
    """Light and dark are the other way round: walls are white, so is what is outside of them."""
    found = imported(tmp_path, lambda x, y: ~ring(x, y) & (np.hypot(x, y) > 9.0))
    assert "swap light and dark with negate" in found.remark
    assert found.course.length > 20.0 * np.pi


def test_an_import_says_that_lengths_are_of_another_unit(tmp_path: Path) -> None:
    table = tmp_path / "cm.csv"
    angle = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    half = np.full(100, 80.0)
    rows = np.column_stack([500.0 * np.cos(angle), 500.0 * np.sin(angle), half, half])
    np.savetxt(table, rows, delimiter=",")
    found = import_course(table, tmp_path / "ring.toml", title="Ring")
    assert found.remark == (
        "it is 160 m wide on average: check the unit (all columns are in metres)"
    )


def test_a_map_without_a_closed_corridor_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TrackError, match="no closed corridor"):
        imported(tmp_path, lambda x, y: ring(x, y) & (x < 6.0))


@pytest.mark.parametrize(("step", "scale"), [(0.1, "1/10"), (0.3, "kart")])
def test_the_width_tells_the_scale(tmp_path: Path, step: float, scale: str) -> None:
    done = imported(tmp_path, ring, step=step)  # 4 m, and 12 m wide
    assert (done.scale, done.likely_scale) == (scale, scale)
    assert f'scale = "{scale}"' in (tmp_path / "course.toml").read_text()


def test_a_scale_that_is_given_is_taken_and_the_likely_one_told(tmp_path: Path) -> None:
    done = imported(tmp_path, ring, scale="kart")
    assert (done.scale, done.likely_scale) == ("kart", "1/10")


@pytest.mark.parametrize("most", [0.0, 0.2, 0.8])
def test_a_stopped_import_leaves_no_file_behind(tmp_path: Path, most: float) -> None:
    def stop(share: float) -> None:
        if share > most:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        imported(tmp_path, ring, report=stop)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drawn.png", "drawn.yaml"]


def test_a_course_that_cannot_be_written_leaves_no_map_behind(tmp_path: Path) -> None:
    (tmp_path / "course.toml").mkdir()
    with pytest.raises(TrackError, match=r"course\.toml: cannot be written"):
        imported(tmp_path, ring)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["course.toml", "drawn.png", "drawn.yaml"]


def test_the_kept_map_is_free_where_the_drawn_one_is(tmp_path: Path) -> None:
    imported(tmp_path, ring)
    beside = map_beside(tmp_path / "course.toml")
    assert beside is not None
    kept, drawn = read_map(beside), read_map(tmp_path / "drawn.yaml")
    assert np.array_equal(kept.free, drawn.free)
    assert kept.file.origin == drawn.file.origin


def test_an_import_writes_over_nothing_that_it_read(tmp_path: Path) -> None:
    words = draw(tmp_path, ring).read_text()
    picture = (tmp_path / "drawn.png").rename(tmp_path / "hall.map.png")
    before = picture.read_bytes()
    for name in ("hall.yaml", "hall.map.yaml"):
        (tmp_path / name).write_text(words.replace("drawn.png", "hall.map.png"))
    with pytest.raises(TrackError, match=r"hall\.map\.png: the picture of the map, which would be"):
        import_course(tmp_path / "hall.yaml", tmp_path / "hall.toml", title="Hall")
    import_course(tmp_path / "hall.map.yaml", tmp_path / "hall.toml", title="Hall")
    assert picture.read_bytes() == before
    assert map_beside(tmp_path / "hall.toml") == tmp_path / "hall.map.yaml"


def test_a_course_is_not_written_beside_the_map_of_another(tmp_path: Path) -> None:
    imported(tmp_path, ring)
    before = (tmp_path / "course.toml").read_bytes()
    (tmp_path / "square.csv").write_text("0,0,1,1\n9,0,1,1\n9,9,1,1\n0,9,1,1\n")
    with pytest.raises(
        TrackError, match=r"course\.map\.yaml: the map of another course, .* remove"
    ):
        import_course(tmp_path / "square.csv", tmp_path / "course.toml", title="Square")
    assert (tmp_path / "course.toml").read_bytes() == before
    imported(tmp_path, ring)  # another map takes its place


def test_check_finds_samples_in_a_wall(tmp_path: Path) -> None:
    course = imported(tmp_path, ring).course
    line = course.line + np.array([2.5, 0.0, 0.0, 0.0])
    found = errors_of(replace(course, line=line), tmp_path)
    assert "samples of the line lie in a wall of course.map.yaml" in found[0]


def test_check_finds_a_border_in_a_wall(tmp_path: Path) -> None:
    course = imported(tmp_path, ring).course
    wide = replace(course, half_widths=course.half_widths + np.array([0.0, 1.0]))
    found = errors_of(wide, tmp_path)
    assert len(found) == 1
    assert "the right border at" in found[0]
    assert "1.0" in found[0].split(" m inside")[0]


def test_check_compares_the_vehicle_with_the_narrowest_place_of_the_map(tmp_path: Path) -> None:
    course = imported(tmp_path, ring, step=0.04).course  # 1.6 m wide; a kart needs 1.99 m
    found = errors_of(course, tmp_path, KART_60)
    (narrow,) = [what for what in found if what.startswith("course.map.yaml is")]
    assert float(narrow.split()[2]) == pytest.approx(1.6, abs=0.06)
    assert "kart-60 needs 1.99 m" in narrow


@pytest.mark.parametrize("key", ["image", "resolution", "origin"])
def test_a_map_without_a_key_names_it(tmp_path: Path, key: str) -> None:
    path = draw(tmp_path, ring)
    lines = [line for line in path.read_text().splitlines() if not line.startswith(key)]
    path.write_text("\n".join(lines))
    with pytest.raises(TrackError, match=f"the key {key} is missing"):
        import_course(path, tmp_path / "course.toml", title="r")


def test_points_return_from_the_picture_of_a_turned_map(tmp_path: Path) -> None:
    occupancy = read_map(draw(tmp_path, ring))
    turned = replace(occupancy, file=replace(occupancy.file, origin=(3.0, -2.0, 0.7)))
    points = np.array([[1.0, 2.0], [-4.0, 0.5]])
    assert turned.points_of(turned.pixels_of(points)) == pytest.approx(points)
    # The lower left corner of the picture lies in the origin.
    assert turned.pixels_of(np.array([[3.0, -2.0]])) == pytest.approx(np.array([[1.0, 301.0]]))


def test_a_ray_ends_at_the_wall(tmp_path: Path) -> None:
    occupancy = read_map(draw(tmp_path, ring))
    east, here = np.array([[1.0, 0.0]]), np.array([[10.0, 0.0]])
    assert occupancy.ranges_to_walls(here, east, 5.0) == pytest.approx([2.0], abs=0.03)
    assert occupancy.ranges_to_walls(here, -east, 1.5) == pytest.approx([1.5])


def flooded(mask: Any, *, diagonal: bool) -> list[set[tuple[int, int]]]:
    """Return the connected parts of a mask, one pixel after the other."""
    around = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if diagonal or 0 in (r, c)]
    left, parts = {(int(r), int(c)) for r, c in np.argwhere(mask)}, []
    while left:
        part, queue = set(), deque([left.pop()])
        while queue:
            row, column = queue.popleft()
            part.add((row, column))
            for near in {(row + r, column + c) for r, c in around} & left:
                left.remove(near)
                queue.append(near)
        parts.append(part)
    return parts


@given(arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))), st.booleans())
@settings(max_examples=60)
def test_parts_of_a_map_are_those_that_a_flood_finds(mask: Any, diagonal: bool) -> None:
    parts, sizes = parts_of(mask, "m", diagonal=diagonal)
    found = {frozenset(zip(*np.nonzero(parts == n), strict=True)) for n in np.unique(parts[mask])}
    flood = flooded(mask, diagonal=diagonal)
    assert found == {frozenset(part) for part in flood}
    assert sorted(sizes[sizes > 0]) == sorted(len(part) for part in flood)


def test_an_imported_course_is_the_one_that_its_file_describes(tmp_path: Path) -> None:
    done = imported(tmp_path, ring)
    assert load_course(str(tmp_path / "course.toml")).digest == done.course.digest


def bent_room(x: Any, y: Any) -> Any:
    """A room around a corner, with a wall as bent as it in its middle."""
    wide = (np.abs(x - 3.5) < 8.5) & (y > -1.5) & (y < 6.0)
    deep = (x > 1.3) & (x < 12.0) & (y > -7.5) & (y < 6.0)
    corners = np.array([[-0.4, 1.4], [4.6, 2.7], [5.3, -3.2]])
    away = np.full(np.shape(x), np.inf)
    for start, end in pairwise(corners):
        way = end - start
        share = np.clip(((x - start[0]) * way[0] + (y - start[1]) * way[1]) / (way @ way), 0.0, 1.0)
        off = np.hypot(x - start[0] - share * way[0], y - start[1] - share * way[1])
        away = np.minimum(away, off)
    return (wide | deep) & (away > 0.15)


def test_a_kart_that_keeps_close_to_a_bent_wall_goes_forwards_on_its_course(tmp_path: Path) -> None:
    course = imported(tmp_path, bent_room, scale="1/10").course
    turns = [(-0.9, 1.4), (-0.3, 0.9), (4.1, 2.0), (4.75, -3.2), (5.3, -3.7), (5.9, -3.2)]
    turns += [(5.2, 2.7), (4.6, 3.3), (-0.5, 1.9), (-0.9, 1.4)]
    once = np.concatenate([np.linspace(one, other, 80) for one, other in pairwise(turns)])
    path = np.concatenate([once] * 3)
    world = make_world(Scenario(course, karts=1))
    header, body, racer = world.route.courses[0], world.bodies[0, 0], world.racers[0, 0]
    body.status = codes.RACING
    racer.line_index = nearest_sample_anywhere(world.route, header, *path[0])
    racer.progress, _ = progress_of(world.route, header, *path[0], racer.line_index)
    gates = world.route.gates["progress"]
    racer.zone = int(np.searchsorted(gates, racer.progress, side="right")) - 1
    racer.next_gate = (racer.zone + 1) % len(gates)
    racer.started, racer.distance, least = 1, 0.0, 0.0
    for x, y in path:
        before = float(racer.distance)
        body.x, body.y = x, y
        follow_course(world, 0)
        least = min(least, float(racer.distance) - before)
    assert least > -1.0
    # Where the line is as near before a bend as behind it, it may be on either.
    assert racer.distance == pytest.approx(3.0 * course.length, abs=6.0)
    assert racer.laps == 3
    assert racer.penalty_us == 0
