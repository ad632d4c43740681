"""The grid over the walls of a course is made once, while its memory is small."""

import numpy as np
import pytest

from race_server.core import codes
from race_server.scenario.track import walls
from race_server.scenario.track.walls import Fence, pack_walls


def square(side: float) -> Fence:
    corners = np.array([[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]])
    segments = np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1)
    return Fence(segments, np.full(4, codes.BORDER, np.uint8), 1.0)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the sides of the squares whose grids are made from here on."""
    sides: list[float] = []
    make = walls._made_grid

    def counted(segments: walls.Floats, cell: float) -> walls._Grid:
        sides.append(float(segments.max()))
        return make(segments, cell)

    monkeypatch.setattr(walls, "_made_grid", counted)
    monkeypatch.setattr(walls, "_kept", {})
    return sides


def test_the_walls_of_twenty_courses_are_gone_through_once(made: list[float]) -> None:
    sides = [10.0 + number for number in range(20)]
    first = [pack_walls([square(side)]) for side in sides]
    again = [pack_walls([square(side)]) for side in sides]
    assert made == sides
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.cell_walls, other.cell_walls)


def test_the_grid_goes_first_that_was_not_asked_for_longest(
    made: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Of squares of 30 to 32 m: two of these grids fit, but not three.
    one = walls._bytes_of(walls._made_grid(square(32.0).segments, 1.0))
    monkeypatch.setattr(walls, "KEPT", int(2.5 * one))
    made.clear()
    for side in (30.0, 31.0, 30.0, 32.0, 30.0, 31.0):
        pack_walls([square(side)])
    assert made == [30.0, 31.0, 32.0, 31.0]


def test_the_latest_grid_is_kept_however_large_it_is(
    made: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(walls, "KEPT", 1)
    for _ in range(2):
        assert len(pack_walls([square(20.0)]).cell_clear) == 22 * 22
    pack_walls([square(21.0)])
    assert [key[0] for key in walls._kept] == [square(21.0).segments.tobytes()]
