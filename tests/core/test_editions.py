"""What the second edition of the rule book changed; recordings of the first race by the first."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from race_server.core import codes
from race_server.core.messages import Status
from race_server.core.rules.edition import FIRST, NEWEST, SECOND
from race_server.core.rules.items import items
from race_server.core.state import World
from race_server.core.step import advance
from race_server.scenario.race import Rules, Scenario, make_world
from race_server.storage.recording.scenario_codec import pack_scenario, unpack_scenario
from race_server.storage.results.keeper import rules_version
from support.courses import SMALL_RING

QUICK = Rules(countdown_s=0.0, laps=0)
PULSE = 1 + [item.name for item in items()].index("pulse")


def world_by(edition: int, karts: int = 1, **rules: object) -> World:
    quick = replace(QUICK, edition=edition, **rules)
    return make_world(Scenario(SMALL_RING, karts=karts, rules=quick))


def test_rules_are_the_newest_and_a_recording_that_does_not_say_is_of_the_first() -> None:
    assert Rules().edition == NEWEST == SECOND
    text, arrays = pack_scenario(Scenario(SMALL_RING, karts=2))
    assert unpack_scenario(text, arrays).rules.edition == SECOND
    words = json.loads(text)
    del words["rules"]["edition"]
    assert unpack_scenario(json.dumps(words), arrays).rules.edition == FIRST


def test_results_name_the_edition_and_those_of_the_first_are_named_as_before() -> None:
    first, second = (rules_version(Rules(edition=edition)) for edition in (FIRST, SECOND))
    assert (first[:2], second[:2]) == ("1-", "2-")
    assert first[2:] == second[2:]


@pytest.mark.parametrize(("edition", "ticks"), [(FIRST, 61), (SECOND, 60)])
def test_a_race_of_a_second_is_over_after_sixty_ticks(edition: int, ticks: int) -> None:
    world = world_by(edition, limit_s=1.0)
    advance(world, np.zeros((1, 1, 4)), ticks - 1)
    assert world.races["over"][0] == 0
    advance(world, np.zeros((1, 1, 4)), 1)
    assert world.races["over"][0] == 1


def use_pulse(edition: int, statuses: tuple[Status, ...]) -> World:
    """Return a world in which the last of some karts has used its pulse. statuses: of the others"""
    world = world_by(edition, len(statuses) + 1)
    for kart, status in enumerate(statuses):
        world.bodies["status"][0, kart] = status
    world.players["held"][0, -1] = PULSE
    controls = np.zeros((1, len(statuses) + 1, 4))
    controls[0, -1, 3] = codes.USE_ITEM
    advance(world, controls, 1)
    return world


@pytest.mark.parametrize(("edition", "kept"), [(FIRST, 0), (SECOND, PULSE)])
def test_a_pulse_is_kept_where_the_kart_ahead_has_finished(edition: int, kept: int) -> None:
    world = use_pulse(edition, (Status.FINISHED,))
    assert world.players["held"][0, 1] == kept
    assert world.players["hits"][0, 0] == 0


@pytest.mark.parametrize(("edition", "hits"), [(FIRST, [0, 0, 0]), (SECOND, [1, 0, 0])])
def test_a_pulse_acts_beyond_a_kart_that_is_out(edition: int, hits: list[int]) -> None:
    world = use_pulse(edition, (Status.RACING, Status.RETIRED))
    assert world.players["hits"][0].tolist() == hits
    assert world.players["held"][0, 2] == 0


def test_a_pulse_still_acts_on_the_next_kart_alone() -> None:
    world = use_pulse(SECOND, (Status.RACING, Status.RACING))
    assert world.players["hits"][0].tolist() == [0, 1, 0]


def lap_on_the_grass(edition: int) -> list[int]:
    """Return which of two laps half a metre off the line were clean: the asphalt is 0.3 m wide."""
    narrow = replace(SMALL_RING, half_widths=np.full_like(SMALL_RING.half_widths, 0.3), grass=0.4)
    rules = replace(QUICK, edition=edition, wall_contact="bump", items=False, limit_s=0.0)
    world = make_world(Scenario(narrow, karts=1, rules=rules))
    told = []
    for degree in range(-5, 725):
        angle, body = math.radians(degree), world.bodies[0, 0]
        body.x, body.y = 6.5 * math.cos(angle), 6.5 * math.sin(angle)
        body.heading, body.speed = angle + 0.5 * math.pi, 0.0
        advance(world, np.zeros((1, 1, 4)), 1)
        rows = world.events[0][: world.event_counts[0]]
        told += [int(row.detail) for row in rows if row.kind == codes.EVENT_LAP]
        world.event_counts[0] = 0
    assert world.racers["off_track"][0, 0] == 1
    return told


@pytest.mark.parametrize(("edition", "clean"), [(FIRST, codes.CLEAN), (SECOND, codes.UNCLEAN)])
def test_a_lap_driven_wholly_on_the_grass_is_not_clean(edition: int, clean: int) -> None:
    assert lap_on_the_grass(edition) == [clean, clean]


def ram(edition: int, rammer: int) -> World:
    """Return a world in which one of two karts ran into the other, touched by a third just before.

    Between their middles lie 10° of the ring, 1.05 m.
    """
    world = world_by(edition, 2, ram_speed=1.0, items=False, stuck_s=0.0)
    for kart in range(2):
        angle, body = math.radians(0.0 if kart == rammer else 10.0), world.bodies[0, kart]
        body.x, body.y = 6.0 * math.cos(angle), 6.0 * math.sin(angle)
        body.heading = angle + 0.5 * math.pi
    advance(world, np.zeros((1, 2, 4)), 36)
    racer = world.racers[0, 1 - rammer]
    racer.contacts, racer.contact_kart_tick = 1, world.races[0].tick
    world.bodies[0, rammer].speed = 4.0
    advance(world, np.zeros((1, 2, 4)), 24)
    return world


@pytest.mark.parametrize("rammer", [0, 1])
def test_who_rams_is_warned_whatever_its_number_and_whoever_touched_the_other_before(
    rammer: int,
) -> None:
    world = ram(SECOND, rammer)
    assert world.racers["warnings"][0, rammer] == 1
    assert world.racers["contacts"][0, rammer] == 1
    assert world.racers["contacts"][0, 1 - rammer] == 2


def test_by_the_first_edition_only_the_clock_of_the_first_kart_was_asked() -> None:
    assert [int(ram(FIRST, rammer).racers["warnings"].sum()) for rammer in (0, 1)] == [1, 0]
