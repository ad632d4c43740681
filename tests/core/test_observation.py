"""What drivers see: the table of parts and the kernel that fills them agree."""

from itertools import pairwise

import numpy as np
import pytest

from race_server.core.messages import Phase
from race_server.core.observation import (
    PARTS,
    PRESETS,
    Observation,
    Part,
    layout_of,
    offsets_of,
)
from race_server.core.stages import observed_parts
from race_server.core.stages.observe import observe_karts
from race_server.core.state import field_of
from race_server.errors import ScenarioError
from race_server.session.session import Session
from support.sessions import session_on_ring


def seen(preset: str = "full", karts: int = 3) -> tuple[Session, Observation]:
    session = session_on_ring("test", karts, countdown_s=2.0)
    for number in range(karts):
        session.join("someone", preset)
        session.seats[number].is_ready = True
    session.start()
    session.observe()
    return session, Observation(0, session.layout(preset), session.view(1).copy())


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_a_layout_is_gapless(preset: str) -> None:
    layout = layout_of(preset, 201)
    places = list(layout.slices.values())
    assert places[0].start == 0
    assert all(a.stop == b.start for a, b in pairwise(places))
    assert places[-1].stop == layout.size


def test_an_unknown_preset_is_named_with_the_known_ones() -> None:
    with pytest.raises(ScenarioError, match="'sonar' is unknown; choose one of lidar"):
        layout_of("sonar", 201)


def test_the_table_and_the_kernel_count_alike() -> None:
    filled = [number for group in observed_parts.GROUPS for number in group]
    assert sorted(filled) == list(range(len(PARTS)))


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_a_part_alone_is_what_it_is_among_all_others(part: Part) -> None:
    session, full = seen()
    alone = layout_of((part.name,), 201)
    values = np.full((1, 3, alone.size + 1), 7.0, np.float32)
    observe_karts(session.world, offsets_of(alone)[None], np.array([-1, 0, -1]), values)
    assert list(values[0, 1, :-1]) == list(full[part.name])
    assert values[0, 1, -1] == 7.0  # nothing is written behind the part
    assert (values[0, [0, 2]] == 7.0).all()  # nor for a kart without a preset


@pytest.mark.parametrize("items", [True, False])
def test_boxes_are_shown_only_in_a_race_with_items(items: bool) -> None:
    session = session_on_ring("test", 1, items=items)
    session.join("anyone", "full")
    session.seats[0].is_ready = True
    session.start()
    session.observe()
    view = Observation(0, session.layout("full"), session.view(0).copy())
    assert (view["boxes_x"] < 1000.0).any() == items


def test_parts_that_a_layout_lacks_have_no_offset() -> None:
    offsets = offsets_of(layout_of(("speed", "radar", "lap"), 201))
    shown = {PARTS[number].name: start for number, start in enumerate(offsets[:-1]) if start >= 0}
    assert shown == {"speed": 0, "radar": 1, "lap": 10}
    assert offsets[-1] == 0  # lidar rays
    assert offsets_of(layout_of("lidar", 201))[-1] == 201


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_every_part_lies_within_its_stated_range(part: object) -> None:
    _, view = seen()
    values = view[part.name]
    assert len(values) == (part.size or 201)
    assert (values >= part.low).all()
    assert (values <= part.high).all()


def test_each_scalar_shows_the_field_of_its_name() -> None:
    session, _ = seen()
    world = session.world
    body, racer, player = world.bodies[0, 1], world.racers[0, 1], world.players[0, 1]
    for number, name in enumerate(
        ("speed", "lateral_speed", "yaw_rate", "steering", "progress", "lateral_offset")
    ):
        field_of(world, name)[0, 1] = 0.1 + number
    body.speed_cap, player.held, racer.laps, racer.wrong_way = 3.5, 2, 4, 1
    session.observe()
    view = Observation(0, session.layout("full"), session.view(1))
    for number, name in enumerate(
        ("speed", "lateral_speed", "yaw_rate", "steering", "progress", "lateral_offset")
    ):
        assert view.scalar(name) == pytest.approx(0.1 + number)
    assert view.scalar("speed_cap") == 3.5
    assert (view.scalar("item"), view.scalar("lap"), view.scalar("wrong_way")) == (2, 4, 1)


def test_the_lights_show_the_time_to_the_start() -> None:
    session, view = seen()
    assert view.scalar("lights") == pytest.approx(2.0)
    session.advance(60)
    session.observe()
    later = Observation(60, session.layout("full"), session.view(1))
    assert later.scalar("lights") == pytest.approx(1.0)


def test_the_kart_in_front_on_the_grid_is_seen_ahead() -> None:
    _, view = seen()
    assert view["karts_x"][0] == pytest.approx(1.0, abs=0.05)
    assert view["karts_x"][1] == pytest.approx(-1.0, abs=0.05)
    assert view["karts_x"][2] == 1000.0


def test_the_radar_sees_the_kart_in_front_as_a_kart() -> None:
    _, view = seen()
    assert view["radar_kind"][4] == 4
    assert view["radar"][4] == pytest.approx(1.0 - 0.225, abs=0.05)


def test_the_path_ahead_begins_in_front_of_the_kart() -> None:
    _, view = seen()
    step = view.scalar("look_ahead")
    assert view["path_ahead_x"][0] == pytest.approx(step, rel=0.1)
    assert np.diff(view["path_ahead_y"][:5]).min() > 0.0  # the ring bends to the left


def test_a_lidar_driver_is_told_nothing_of_the_map() -> None:
    told = set(PRESETS["lidar"])
    assert not told & {"progress", "lateral_offset", "curvature_ahead", "path_ahead_x", "karts_x"}


def test_a_seat_carries_only_the_sensors_that_its_preset_needs() -> None:
    session, _ = seen("track")
    assert session.phase is Phase.COUNTDOWN
    assert session.world.bodies["sensors"].max() == 0
    assert session.world.sight.lidar.max() == 0.0
