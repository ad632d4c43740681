"""Courses, maps and settings that would cost gigabytes or minutes."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.errors import TrackError
from race_server.scenario.text_files import parse_toml, read_text
from race_server.scenario.track.cache import cached
from race_server.scenario.track.course import Course
from race_server.scenario.track.importers import import_course
from race_server.scenario.track.load import read_course, spec_of
from race_server.scenario.track.walls import fence_of, pack_walls
from race_server.tools.drills.bombs import YAML, circle, picture, stripes, table, track
from support.courses import ring


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (track(circle(16e3, 400)), "a course of 101 km; at this scale it may be 8.19 km long"),
        (track(circle(50.0, 5000)), "points = .* give a list of up to 4096 rows"),
        (track(circle(50.0, 40), f"obstacles = [{'[1, 2, 3, 4, 5], ' * 300}]"), "up to 256 rows"),
        (b"a = " + b"[" * 100_000, "no TOML: nested too deep"),
        (b".".join([b"a"] * 20) + b" = 1", "a key in line 1 has more than 16 words"),
        (b"[" + b".".join([b"a"] * 20) + b"]", "a key in line 1 has more than 16 words"),
        (b"\xff", "no TOML"),
    ],
)
def test_a_track_that_is_too_large_is_refused(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "t.toml"
    path.write_bytes(data)
    with pytest.raises(TrackError, match=message if data != b"\xff" else "not UTF-8"):
        read_course(path)


def test_a_border_of_too_many_blocks_is_refused_before_it_is_laid() -> None:
    loop = 'start = [0, 0]\nheading = 0\nblocks = "999xS 999xS"\n'
    words = f'form = "blocks"\n[outer]\n{loop}[inner]\n{loop}'
    from race_server.scenario.track.build import build

    with pytest.raises(TrackError, match="999 blocks of the outer border; at most 256"):
        build(spec_of("b", "b.toml", words.encode()))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (table(circle(100.0, 5000)), "5000 points in .*; at most 4096"),
        (b"1,2,3,4\n" * 200_000, "larger than 1048576 bytes"),
    ],
)
def test_a_csv_that_is_too_large_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "t.csv").write_bytes(content)
    with pytest.raises(TrackError, match=message):
        import_course(tmp_path / "t.csv", tmp_path / "t.toml", scale="kart", title="t")


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (picture(30_000, 30_000), r"map\.png: larger than 16777216 pixels"),
        (picture(10_000, 10_000), r"map\.png: larger than 16777216 pixels"),
        (picture(100, 100), "no picture that can be read"),  # without a single row
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "no picture that can be read"),
        (stripes(4000), r"\d{7} runs of pixels; at most 1048576"),
    ],
)
def test_a_map_that_is_too_large_is_refused(tmp_path: Path, image: bytes, message: str) -> None:
    (tmp_path / "map.png").write_bytes(image)
    (tmp_path / "map.yaml").write_text(YAML)
    with pytest.raises(TrackError, match=message):
        import_course(tmp_path / "map.yaml", tmp_path / "t.toml", scale="1/10", title="t")


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[:200],
        lambda data: data.replace(b"numpy._core", b"numpy._c\xffre"),
        lambda data: data.replace(b"numpy._core", b"numpy._cote"),  # as of another version
        lambda data: data.replace(b"half_widths", b"half_midths"),
    ],
)
def test_a_course_is_built_again_where_its_cache_is_damaged(
    damage: Callable[[bytes], bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RACE_SERVER_CACHE", str(tmp_path))
    built: list[int] = []

    def build() -> Course:
        built.append(1)
        return ring()

    for _ in range(2):
        cached("ring", build)
    (kept,) = (tmp_path / "courses").iterdir()
    assert len(built) == 1
    assert damage(kept.read_bytes()) != kept.read_bytes()
    kept.write_bytes(damage(kept.read_bytes()))
    assert cached("ring", build).length == ring().length
    assert len(built) == 2


def test_a_pipe_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(TrackError, match="it is no file"):
        read_text(tmp_path / "pipe.yaml", 100, TrackError)


def test_numbers_with_points_are_no_words_of_a_key() -> None:
    row = ", ".join(["1.5"] * 100)
    assert parse_toml(f"a = {{ b = [{row}], c.d.e = [{row}] }}")["a"]["c"]["d"]["e"][99] == 1.5
    assert len(parse_toml(f"a = [\n[{row}],\n[{row}]\n]")["a"]) == 2


@pytest.mark.parametrize("width", [1e-3, 1e-300, float("nan")])
def test_a_grid_of_too_many_cells_is_not_made(width: float) -> None:
    with pytest.raises(TrackError, match="the grid over its walls has"):
        pack_walls([fence_of(replace(ring(), width_mean=width))])
