"""The records of a world, and the digest over them."""

import numpy as np
import pytest

from race_server.core.state import (
    BODY,
    BOX,
    EFFECT,
    EFFECTS,
    HASHED,
    HAZARD,
    PLAYER,
    RACE,
    RACER,
    World,
    digest,
    field_of,
    hashed_karts,
)
from race_server.scenario.race import Scenario, make_world
from support.courses import ring


def numbered() -> World:
    """Return a world of two karts in which every number of a kart without trailers is another."""
    world = make_world(Scenario(ring(), karts=2))
    first = 0.0
    for records in (world.bodies, world.racers, world.players):
        numbers = records.view(np.int64).reshape(2, -1)
        if "trailers" in (records.dtype.names or ()):
            numbers = numbers[:, : records.dtype.fields["trailers"][1] // 8]  # they come last
        numbers[:] = first + np.arange(numbers.size).reshape(numbers.shape)
        first += numbers.size
    return world


def test_every_field_of_a_kart_has_one_place_in_the_digest() -> None:
    fields = [name for record in (BODY, RACER, PLAYER) for name in record.names or ()]
    # What trailers do enters the digest of those that draw some.
    assert sorted([*HASHED.split(), "trailers"]) == sorted(fields)
    assert len(set(fields)) == len(fields)


def test_records_hold_numbers_of_eight_bytes_without_gaps() -> None:
    for record in (BODY, RACER, PLAYER, RACE, BOX, HAZARD, EFFECT):
        names = record.names or ()
        assert sum(record[name].itemsize for name in names) == record.itemsize
        assert all(record[name].base.itemsize % 8 == 0 for name in names)


def test_the_digest_takes_the_fields_in_the_declared_order() -> None:
    world, at = numbered(), 0
    rows = hashed_karts(world)
    for name in HASHED.split():
        if name == "effects":
            numbers = world.players["effects"][0].view(np.int64).reshape(2, -1)
        else:
            numbers = field_of(world, name)[0].reshape(2, 1).view(np.int64)
        width = numbers.shape[1]
        assert (rows[:, at : at + width] == numbers).all(), name
        at += width
    assert at == rows.shape[1] == 63 + EFFECTS * EFFECT.itemsize // 8


def test_the_digest_of_a_world_is_what_it_was_when_a_kart_was_one_record() -> None:
    assert digest(numbered()) == "61851a509addb7ad1efec9002bb3f730"


@pytest.mark.parametrize("name", HASHED.split())
def test_a_change_of_any_field_changes_the_digest(name: str) -> None:
    world = numbered()
    before = digest(world)
    if name == "effects":
        world.players["effects"]["until_tick"][0, 1, 3] += 1
    else:
        field_of(world, name)[0, 1] += 1
    assert digest(world) != before


def test_a_field_that_no_record_has_is_refused() -> None:
    with pytest.raises(KeyError, match="wings"):
        field_of(numbered(), "wings")
