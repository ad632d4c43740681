"""Pictures of a race for people and for drivers that see."""

import sys

import gymnasium
import numpy as np
import pytest

from race_server.core import codes
from race_server.core.lots import BLOCK
from race_server.core.vehicle_presets import LORRY
from race_server.envs.parallel import parallel_env
from race_server.envs.render.colours import (
    ASPHALT,
    CONCRETE,
    MINE,
    PALETTE,
    PERSON,
    RETIRED_GREY,
    STANDING,
    mixed,
)
from race_server.envs.render.picture import Picture
from race_server.envs.render.window import Window
from race_server.errors import ScenarioError
from race_server.scenario.race import Scenario, make_world
from support.courses import ring
from support.lots import one_slot, open_lot, park_world, put_axle

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


def test_a_car_park_shows_the_slot_of_each_vehicle_and_that_of_the_one_followed_in_green() -> None:
    course = open_lot(vehicles=2)
    world, picture = park_world(course, vehicles=2), Picture(course)
    lower, upper = (world.parking.parkers[0, k] for k in np.argsort(world.parking.parkers["y"][0]))
    assert (lower.y, upper.y) == (0.0, 10.0)
    tints = {k: mixed(PALETTE[k], ASPHALT, 0.16) for k in (0, 1)}
    for k, parker in enumerate(world.parking.parkers[0]):
        column, row = picture.pixel_of(parker.x, parker.y)
        assert tuple(picture.draw(world)[row, column]) == tints[k]
        assert tuple(picture.draw(world, followed=k)[row, column]) == mixed(MINE, ASPHALT, 0.5)
        assert tuple(picture.draw(world, followed=1 - k)[row, column]) == tints[k]


def test_a_car_park_shows_walls_free_slots_blocks_parked_vehicles_and_people() -> None:
    course = one_slot(length=30.0, width=20.0, people=1)
    world, picture = park_world(course), Picture(course)
    world.bodies["status"] = codes.ABSENT  # so that its slot is like any other
    blocks = np.zeros((1, 2), BLOCK)
    for block, x, kind in zip(
        blocks[0], (20.0, 25.0), (codes.OBSTACLE, codes.KART_HIT), strict=True
    ):
        block["x"], block["half_length"], block["half_width"], block["kind"] = x, 1.5, 1.5, kind
    world = world._replace(parking=world.parking._replace(blocks=blocks))
    walker = world.parking.walkers[0, 0]

    def colour_at(x: float, y: float) -> tuple[int, ...]:
        column, row = picture.pixel_of(x, y)
        return tuple(picture.draw(world)[row, column])

    assert colour_at(walker.x, walker.y) == PERSON
    assert (colour_at(20.0, 0.0), colour_at(25.0, 0.0)) == (CONCRETE, STANDING)
    assert colour_at(-30.0, 30.0) == colour_at(0.0, 0.0) == ASPHALT
    assert min(colour_at(0.0, 10.0)) > max(ASPHALT)  # the white line of the slot
    assert max(colour_at(-50.0, 0.0)) < min(ASPHALT)  # the wall


def test_a_lorry_shows_its_trailer_behind_it() -> None:
    course = open_lot(vehicles=1)
    world, picture = park_world(course, vehicle=LORRY), Picture(course)
    put_axle(world, 20.0, -20.0)
    for behind, colour in ((4.0, PALETTE[0]), (8.0, PALETTE[0]), (14.0, ASPHALT)):  # the axle [m]
        column, row = picture.pixel_of(20.0 - behind, -20.0)
        assert tuple(picture.draw(world)[row, column]) == colour


@pytest.mark.parametrize(
    "name",
    ["Kart/TimeTrial-v0", "Kart/ParkGoal-v0", "Kart/ParkCompatible-v0"],
)
def test_a_window_shows_every_reset_and_every_step(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[int, ...]] = []
    monkeypatch.setattr(Window, "show", lambda _, frame: shown.append(frame.shape))
    for mode, pictures in (("human", 3), ("rgb_array", 0), (None, 0)):
        made = gymnasium.make(name, render_mode=mode, disable_env_checker=True).unwrapped
        made.reset(seed=1)
        made.step(np.zeros(made.action_space.shape or (), np.float32))
        made.step(np.zeros(made.action_space.shape or (), np.float32))
        assert len(shown) == pictures
        shown.clear()


def test_a_window_shows_every_reset_and_every_step_of_several(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown: list[tuple[int, ...]] = []
    monkeypatch.setattr(Window, "show", lambda _, frame: shown.append(frame.shape))
    race = parallel_env(track="oval", karts=2, render_mode="human")
    race.reset(seed=1)
    race.step({})
    assert len(shown) == 2


def test_a_window_without_pygame_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ScenarioError, match="pip install pygame"):
        Window().show(np.zeros((64, 64, 3), np.uint8))
