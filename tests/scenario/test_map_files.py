"""Maps as other programs write them: their YAML and their pictures."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from race_server.errors import TrackError
from race_server.scenario.track.occupancy_map import MapFile, read_map, read_map_file

# Two rows of a picture: free, occupied, unknown as a grey that is darker than free.
FREE = np.array([[True, False, False], [True, True, False]])
YAML = """image: map.png
resolution: 0.05
origin: [-1.0, 2.0, 0.5]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
GREY = np.array([[254, 0, 205], [254, 254, 205]])


def read(folder: Path, text: str, name: str = "map.yaml") -> MapFile:
    (folder / name).write_bytes(text.encode())
    return read_map_file(folder / name)


def free_of(folder: Path, picture: Any, yaml: str = YAML) -> Any:
    """Return which pixels of a picture are free."""
    Image.fromarray(picture).save(folder / "map.png")
    (folder / "map.yaml").write_text(yaml)
    return read_map(folder / "map.yaml").free[1:-1, 1:-1]


def in_colours(*rows: Any) -> Any:
    return np.array(rows, np.uint8).reshape(2, 3, -1)


# YAML


@pytest.mark.parametrize(
    "text",
    [
        YAML.replace("[-1.0, 2.0, 0.5]", "\n- -1.0\n- 2.0\n- 0.5"),
        YAML.replace("[-1.0, 2.0, 0.5]", "\n  - -1\n  - 2e0  # up\n  - .5"),
        YAML.replace("[-1.0, 2.0, 0.5]", "[-1.0,\n  2.0,  # up\n  0.5]"),
        YAML.replace("\n", "\r\n"),
        "\ufeff" + YAML,
        "# image: no.png\n---\n" + YAML.replace("0.05", "0.05  # [m]"),
        YAML.replace("map.png", "'map.png' # mine"),
        YAML + "mode: trinary\n",
    ],
)
def test_a_map_file_says_the_same_however_it_is_written(text: str, tmp_path: Path) -> None:
    words = read(tmp_path, text)
    assert (words.image, words.resolution, words.origin) == (
        tmp_path / "map.png",
        0.05,
        (-1.0, 2.0, 0.5),
    )
    assert (words.negate, words.free_below, words.mode) == (False, 0.196, "trinary")


@pytest.mark.parametrize("name", ["map#1.png", '"a map #1.png"', "'é map.png'", "/maps/a.pgm"])
def test_a_picture_has_the_name_that_it_is_given(name: str, tmp_path: Path) -> None:
    words = read(tmp_path, YAML.replace("map.png", name))
    assert words.image == tmp_path / name.strip("\"'")


@pytest.mark.parametrize(
    ("word", "negate"),
    [("0", False), ("no", False), ("FALSE", False), ("1", True), ("true", True), ("Yes", True)],
)
def test_negate_is_a_truth_value(word: str, negate: bool, tmp_path: Path) -> None:
    assert read(tmp_path, YAML.replace("negate: 0", f"negate: {word}")).negate is negate


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.05", "0.05 m", "resolution = 0.05 m: give metres per pixel"),
        ("0.05", "", "resolution = : give metres per pixel"),
        ("[-1.0, 2.0, 0.5]", "[-1.0, 2.0]", "give three finite numbers"),
        ("[-1.0, 2.0, 0.5]", "[-1.0, 2.0, nan]", "give three finite numbers"),
        ("0.5]", "90]", "the angle is in radians, up to one turn"),
        ("negate: 0", "negate: maybe", "negate = maybe: give 0 or 1"),
        ("0.196", "19.6", "free_thresh = 19.6: give a share above 0, up to 1"),
        ("0.05", "1e-6", "resolution = 1e-6: give metres per pixel, 0.001 to 10"),
        ("-1.0", "-1e9", "stay within 100000 m of zero"),
        ("0.65", "65", "occupied_thresh = 65: give a share from free_thresh .0.196. to 1"),
        ("0.65", "0.1", "occupied_thresh = 0.1: give a share from free_thresh"),
        ("0.196", "0.196\nmode: grey", "mode = grey: choose one of trinary, scale, raw"),
    ],
)
def test_a_wrong_value_of_a_map_is_named(old: str, new: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(TrackError, match=rf"map\.yaml: .*{message}"):
        read(tmp_path, YAML.replace(old, new))


# Pictures


@pytest.mark.parametrize(
    "picture",
    [
        GREY.astype(np.uint8),
        (GREY * 257).astype(np.uint16),
        in_colours(*([(v, v, v) for v in row] for row in GREY.tolist())),
    ],
)
def test_a_map_is_the_same_of_8_bits_of_16_and_in_colours(picture: Any, tmp_path: Path) -> None:
    assert np.array_equal(free_of(tmp_path, picture), FREE)


def test_the_brightness_of_a_colour_is_the_mean_of_its_parts(tmp_path: Path) -> None:
    # Yellow looks bright, and is two thirds of white; so does map_server take it.
    white, yellow, red = (255, 255, 255), (255, 255, 0), (255, 0, 0)
    picture = in_colours([white, yellow, red], [white, white, red])
    assert np.array_equal(free_of(tmp_path, picture), FREE)


def test_a_gap_of_two_pixels_in_a_wall_is_closed_and_one_of_three_is_not(tmp_path: Path) -> None:
    picture = np.full((21, 40), 254, np.uint8)
    picture[10] = 0
    picture[10, 10:12] = picture[10, 25:28] = 254
    free = free_of(tmp_path, picture)
    assert np.flatnonzero(free[10]).tolist() == [25, 26, 27]
    assert free[:10].all()
    assert free[11:].all()


def test_a_finer_map_has_wider_gaps_closed(tmp_path: Path) -> None:
    picture = np.full((41, 40), 254, np.uint8)
    picture[20] = 0
    picture[20, 10:19] = 254
    yaml = YAML.replace("0.05", "0.01")  # 9 cm are 9 pixels
    assert not free_of(tmp_path, picture, yaml)[20].any()


def test_no_ray_passes_between_two_pixels_that_touch_at_a_corner(tmp_path: Path) -> None:
    picture = np.full((100, 100), 254, np.uint8)
    picture[np.arange(100), np.arange(100)] = 0
    free_of(tmp_path, picture, YAML.replace("[-1.0, 2.0, 0.5]", "[0.0, 0.0, 0.0]"))
    occupancy = read_map(tmp_path / "map.yaml")
    # From 1 m beside the wall, across it: 45 degrees to the pixels.
    along = np.linspace(1.0, 4.0, 301)
    across = np.full((301, 2), np.sqrt(0.5))
    points = np.column_stack([along, 5.0 - along]) - across
    assert occupancy.ranges_to_walls(points, across, 3.0) == pytest.approx(np.ones(301), abs=0.06)


def test_what_is_transparent_is_not_free(tmp_path: Path) -> None:
    paper, ink, nothing = (255, 255, 255, 255), (0, 0, 0, 255), (255, 255, 255, 0)
    picture = in_colours([paper, ink, nothing], [paper, paper, nothing])
    assert np.array_equal(free_of(tmp_path, picture), FREE)


def test_a_raw_map_holds_the_numbers_of_the_occupancy_grid(tmp_path: Path) -> None:
    picture = np.array([[0, 100, 255], [0, 19, 20]], np.uint8)
    assert np.array_equal(free_of(tmp_path, picture, YAML + "mode: raw\n"), FREE)


@pytest.mark.parametrize("negate", [lambda grey: grey, lambda grey: 255 - grey])
def test_a_negated_map_is_dark_where_it_is_free(
    negate: Callable[[Any], Any], tmp_path: Path
) -> None:
    picture = negate(GREY).astype(np.uint8)
    yaml = YAML.replace("negate: 0", f"negate: {int(picture[0, 0] < 128)}")
    assert np.array_equal(free_of(tmp_path, picture, yaml), FREE)


def test_another_kind_of_picture_is_named_with_those_that_are_read(tmp_path: Path) -> None:
    Image.fromarray(GREY.astype(np.uint8)).save(tmp_path / "map.jpg")
    (tmp_path / "map.yaml").write_text(YAML.replace("map.png", "map.jpg"))
    with pytest.raises(TrackError, match=r"map\.jpg: no picture .*; give a PGM, PNG or BMP"):
        read_map(tmp_path / "map.yaml")
