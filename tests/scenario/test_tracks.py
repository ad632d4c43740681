"""Courses: the shipped ones, the three forms, and files that are wrong."""

import contextlib
import json
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from race_server.core.vehicle_presets import KART_30, TT02, VEHICLES
from race_server.errors import ScenarioError, TrackError
from race_server.scenario.track.blocks import Loop, lay
from race_server.scenario.track.check import check_course
from race_server.scenario.track.draw import draw_course
from race_server.scenario.track.load import load_course, read_course, spec_of, summary, track_names
from race_server.scenario.track.polyline import area_of, crossings, lengths_of, nearest_on
from support.courses import ring

VEHICLE_OF = {"hangar-400": "kart-30", "colline-1100": "kart-60", "paddock-280": "kart-30"}

SQUARE = """
title = "Square"
form = "blocks"
[outer]
start = [0.0, 0.0]
heading = 0.0
blocks = "4xS L 4xS L 4xS L 4xS L"
[inner]
start = [1.5, 1.0]
heading = 0.0
blocks = "S L 2xS L S L 2xS L"
"""

LINE = """
form = "line"
scale = "kart"
half_width = 3.0
points = [[0, 0], [30, 0], [60, 0], [80, 20], [60, 40], [30, 40], [0, 40], [-20, 20]]
"""


@pytest.mark.parametrize(
    ("name", "length", "narrow", "mean", "wide"),
    [
        ("covapsy-base", 35.4, 0.90, 1.39, 2.13),
        ("covapsy-train-2023", 33.2, 0.90, 1.22, 1.66),
        ("covapsy-test-2023", 57.0, 0.90, 1.00, 1.25),
    ],
)
def test_block_tracks_measure_what_others_measured_on_them(
    name: str, length: float, narrow: float, mean: float, wide: float
) -> None:
    figures = summary(load_course(name))
    assert figures["length_m"] == pytest.approx(length, rel=0.005)
    assert figures["width_min_m"] == pytest.approx(narrow, rel=0.005)
    assert figures["width_mean_m"] == pytest.approx(mean, rel=0.005)
    assert figures["width_max_m"] == pytest.approx(wide, rel=0.005)


@pytest.mark.parametrize(
    ("name", "outer", "inner", "area"),
    [
        ("covapsy-base", 43.14, 33.14, 57.0),
        ("covapsy-train-2023", 40.57, 29.57, 46.5),
        ("covapsy-test-2023", 63.56, 55.56, 66.0),
    ],
)
def test_border_loops_measure_what_others_measured_on_them(
    name: str, outer: float, inner: float, area: float
) -> None:
    path = Path(__file__).parents[2] / "tracks" / f"{name}.toml"
    plan = spec_of(name, path.name, path.read_bytes())
    assert plan.outer is not None
    assert plan.inner is not None
    loops = [lay(plan.outer, 0.0), lay(plan.inner, 0.0)]
    assert lengths_of(loops[0]).sum() == pytest.approx(outer, rel=0.001)
    assert lengths_of(loops[1]).sum() == pytest.approx(inner, rel=0.001)
    assert abs(area_of(loops[0])) - abs(area_of(loops[1])) == pytest.approx(area, abs=0.01)


def test_the_oval_is_two_straights_and_a_circle_long() -> None:
    assert load_course("oval").length == pytest.approx(12.0 + 3.0 * np.pi, rel=0.001)


def test_the_kart_tracks_are_as_long_as_their_names_say() -> None:
    assert load_course("hangar-400").length == pytest.approx(400.0, rel=0.01)
    assert load_course("colline-1100").length == pytest.approx(1100.0, rel=0.01)


@pytest.mark.parametrize("name", track_names())
def test_every_shipped_track_can_be_raced(name: str) -> None:
    vehicle = VEHICLES[VEHICLE_OF.get(name, "tt02")]
    assert [f for f in check_course(load_course(name), vehicle) if f.level == "error"] == []


@pytest.mark.parametrize("name", track_names())
def test_the_line_of_every_track_stays_between_its_borders(name: str) -> None:
    course = load_course(name)
    clear, _ = nearest_on(course.borders, course.line[:, :2])
    assert clear.min() > 0.35
    assert np.hypot(*np.diff(course.line[:, :2], axis=0).T) == pytest.approx(
        course.spacing, rel=0.05
    )


@pytest.mark.parametrize("name", track_names())
def test_heading_turns_once_to_the_left_around_every_track(name: str) -> None:
    course = load_course(name)
    assert (course.line[:, 3] * course.spacing).sum() == pytest.approx(2.0 * np.pi, abs=0.05)


@pytest.mark.parametrize("name", track_names())
def test_the_grid_lies_behind_the_timing_line_in_order(name: str) -> None:
    course = load_course(name)
    assert len(course.grid) >= 10
    index = [int(np.argmin(np.hypot(*(course.line[:, :2] - p[:2]).T))) for p in course.grid[:10]]
    assert index == sorted(index, reverse=True)
    assert index[0] > 0.8 * len(course.line)


def test_a_square_of_blocks_is_as_wide_as_its_blocks_say(tmp_path: Path) -> None:
    path = tmp_path / "square.toml"
    path.write_text(SQUARE)
    course = read_course(path)
    # 5 m outside and 2 m by 3 m inside, so 1 m between the lines and 0.05 m of border each side.
    assert course.width_min == pytest.approx(0.9, abs=0.01)


def test_an_open_border_says_how_far_its_ends_are_apart(tmp_path: Path) -> None:
    path = tmp_path / "open.toml"
    path.write_text(SQUARE.replace("4xS L 4xS L 4xS L 4xS L", "4xS L 4xS L 4xS L 3xS L"))
    with pytest.raises(TrackError, match=r"open.toml: outer border is open: it ends 1.00 m"):
        read_course(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("4xS L 4xS", "4xQ L 4xS", "outer border, piece 1: '4xQ' is no block"),
        ("heading = 0.0", "heading = true", "outer.heading = True: give a number in degrees"),
        ('form = "blocks"', 'form = "bricks"', "form = 'bricks': choose one of blocks, line"),
        ('title = "Square"', "gates = 2", "gates = 2: give a whole number from 3 to 200"),
        ('title = "Square"', "kerbs = 2", "kerbs = 2: no such key"),
        ('title = "Square"', 'title = "', "no TOML"),
        ("[inner]", "[insider]", "inner is missing: give a table with start, heading and blocks"),
        ("start = [1.5, 1.0]", "start = [9.5, 1.0]", "does not lie inside the outer one"),
        ("start = [0.0, 0.0]", "start = [nan, 0.0]", "outer.start = .* give 2 numbers"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(SQUARE.replace(old, new, 1))
    with pytest.raises(TrackError, match=message) as caught:
        read_course(path)
    assert str(caught.value).startswith("wrong.toml: ")


def test_a_course_with_a_bridge_is_refused_with_the_place(tmp_path: Path) -> None:
    # A figure of eight whose diagonals meet in (30, 20).
    eight = "points = [[0, 0], [60, 40], [80, 20], [60, 0], [0, 40], [-20, 20]]"
    (tmp_path / "eight.toml").write_text(re.sub(r"points = .*", eight, LINE))
    with pytest.raises(
        TrackError, match=r"crosses itself at \(\d\d\.\d\d, \d\d\.\d\d\).* no bridges"
    ):
        load_course(str(tmp_path / "eight.toml"))


def test_a_crossing_in_a_sample_of_the_line_is_one_too(tmp_path: Path) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    rows = np.column_stack([10.0 * np.sin(angles), 6.0 * np.sin(2.0 * angles)]).tolist()
    path = tmp_path / "eight.toml"
    path.write_text(f'form = "line"\nhalf_width = 1\npoints = {rows}')
    with pytest.raises(TrackError, match=r"crosses itself at \(0\.0\d, -0\.0\d\), 33\.\d m and"):
        read_course(path)


def test_half_widths_that_fall_below_nothing_between_points_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "narrows.toml"
    rows = "[[0, 0, 2, 2], [20, 0, 2, 2], [20, 10, 0.1, 2], [0, 10, 0.1, 2]]"
    path.write_text(f'form = "spline"\npoints = {rows}')
    with pytest.raises(
        TrackError, match=r"a half-width of -0\.\d\d m on the left near .*; let the"
    ):
        read_course(path)


def test_an_unknown_track_is_named_with_the_known_ones() -> None:
    with pytest.raises(TrackError, match="'monza' is unknown; choose one of colline-1100, covapsy"):
        load_course("monza")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(TrackError, match="cannot be read: No such file"):
        load_course(str(tmp_path / "none.toml"))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_a_damaged_file_gives_a_course_or_one_clear_error(data: st.DataObject) -> None:
    text = bytearray(LINE.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(TrackError):
        spec_of("fuzz", "fuzz.toml", bytes(text))


@settings(max_examples=15, deadline=None)
@example([0.0, 0.0, 0.0, 0.0, -0.25, 0.1875, -0.1875, 0.0], 3.5)  # a fold that left a knot
@given(st.lists(st.floats(-0.25, 0.25), min_size=8, max_size=8), st.floats(1.0, 4.0))
def test_borders_of_a_bumpy_ring_never_cross_and_keep_their_distance(
    bumps: list[float], half_width: float
) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    radius = 30.0 * (1.0 + np.array(bumps))
    rows = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1).tolist()
    words = ('form = "spline"', 'scale = "kart"', f"half_width = {half_width}")
    text = "\n".join([*words, f"points = {json.dumps(rows)}"])
    plan = spec_of("bumpy", "bumpy.toml", text.encode())
    from race_server.scenario.track.build import build

    course = build(plan)
    assert len(crossings(course.borders)) == 0
    clear, _ = nearest_on(course.borders, course.line[:, :2])
    assert clear.min() > 0.95 * half_width


def test_check_finds_a_track_too_narrow_for_a_kart() -> None:
    errors = [f.what for f in check_course(load_course("oval"), KART_30) if f.level == "error"]
    assert any("1.20 m wide at the narrowest; kart-30 needs 1.99 m" in what for what in errors)


def test_check_finds_a_gap_in_a_border() -> None:
    from dataclasses import replace

    course = ring()
    broken = replace(course, borders=np.delete(course.borders, 5, axis=0))
    assert any("the border is open" in finding.what for finding in check_course(broken, TT02))


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_a_course_is_drawn_as_png_or_svg(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"oval{suffix}"
    draw_course(load_course("oval"), path)
    assert path.stat().st_size > 10_000


def test_a_title_in_any_script_is_drawn_without_a_word(tmp_path: Path) -> None:
    course = replace(ring(), title="鈴鹿 🏎")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        draw_course(course, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 1000


def test_another_kind_of_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"as \.png or \.svg"):
        draw_course(load_course("oval"), tmp_path / "oval.bmp")


def test_a_loop_laid_to_the_left_of_its_line_is_smaller() -> None:
    loop = Loop("outer", 0.0, 0.0, 0.0, "S L S L S L S L")
    # A square of 1 m straights and rounded corners: 2 m across, 0.1 m less from side to side.
    assert np.ptp(lay(loop, 0.0)[:, 0]) == pytest.approx(2.0)
    assert np.ptp(lay(loop, 0.05)[:, 0]) == pytest.approx(1.9)
