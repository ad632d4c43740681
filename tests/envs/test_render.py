"""Pictures of a race for people and for drivers that see."""

import sys

import numpy as np
import pytest

from race_server.core import codes
from race_server.envs.render.colours import PALETTE, RETIRED_GREY
from race_server.envs.render.picture import Picture
from race_server.envs.render.window import Window
from race_server.errors import ScenarioError
from race_server.scenario.race import Scenario, make_world
from support.courses import ring

COURSE = ring()
PICTURE = Picture(COURSE, (320, 240))


def test_a_picture_has_the_size_asked_for_and_three_bytes_to_a_pixel() -> None:
    frame = PICTURE.draw(make_world(Scenario(COURSE, karts=3)), names=("ann", "bo"))
    assert frame.shape == (240, 320, 3)
    assert frame.dtype == np.uint8


@pytest.mark.parametrize(("x", "y"), [(20.0, 0.0), (0.0, 20.0), (-20.0, 0.0), (0.0, -20.0)])
def test_a_kart_has_its_colour_where_it_stands_and_grey_once_it_retired(x: float, y: float) -> None:
    world = make_world(Scenario(COURSE, karts=3))
    bodies = world.bodies[0]
    bodies["status"][:2] = codes.ABSENT
    bodies["x"][2], bodies["y"][2], bodies["heading"][2] = x, y, np.arctan2(x, -y)
    column, row = PICTURE.pixel_of(x, y)
    assert tuple(PICTURE.draw(world)[row, column]) == PALETTE[2]
    bodies["status"][2] = codes.RETIRED
    assert tuple(PICTURE.draw(world)[row, column]) == RETIRED_GREY


def test_a_kart_that_moved_changes_the_picture() -> None:
    world = make_world(Scenario(COURSE, karts=2))
    before = PICTURE.draw(world)
    world.bodies["y"][0, 1] += 3.0
    assert np.any(PICTURE.draw(world) != before)


def test_what_is_drawn_leaves_no_trace_in_the_next_picture() -> None:
    world = make_world(Scenario(COURSE, karts=2))
    before = PICTURE.draw(world)
    elsewhere = make_world(Scenario(COURSE, karts=2))
    elsewhere.bodies["x"][0] = -20.0, 1e6  # one of them far outside the picture
    elsewhere.hazards["until_tick"][0, 0] = 9
    PICTURE.draw(elsewhere)[:] = 0
    assert np.array_equal(PICTURE.draw(world), before)


def test_a_window_without_pygame_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ScenarioError, match="pip install pygame"):
        Window().show(np.zeros((64, 64, 3), np.uint8))
