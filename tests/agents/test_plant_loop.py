"""The whole loop of a real kart with the plant, against a server."""

import math

import numpy as np
import pytest

from race_agents.plant.radar import Person, gap_to
from race_agents.unit.control_unit import UNSEEN_S
from race_server.core.alert import Cause
from race_server.core.messages import Control, EventKind, Status, Trust
from race_server.core.rules.items import items
from race_server.core.vehicle_presets import TT02
from support.plant_loop import Loop


@pytest.mark.parametrize("scale", ["1/10", "kart"])
def test_a_plant_drives_laps_where_the_server_says_it_is(scale: str) -> None:
    loop = Loop(scale).run(6.0)
    errors = []
    for _ in range(60):
        loop.run(1 / 60)
        body = loop.session.world.bodies[0, 0]
        errors.append(math.hypot(body.x - loop.plant.body.x, body.y - loop.plant.body.y))
    speed = loop.plant.body.speed
    assert speed > 1.0
    # The server shows the kart as of the tick that comes, the body is one tick on.
    assert np.median(errors) < 0.1 + 2.0 * speed / 60.0
    loop.run(24.0 if scale == "1/10" else 30.0)
    assert loop.session.world.racers["laps"][0, 0] >= 1
    assert loop.session.tracked_karts.trackers[0].trust is Trust.TRUSTED
    assert loop.plant.scrapes == 0


def test_a_plant_obeys_an_effect() -> None:
    loop = Loop().run(4.0)
    names = [item.name for item in items()]
    world = loop.session.world
    before = loop.plant.body.speed
    pulse = world.items[names.index("pulse") + 1]
    assert before > 1.0
    effect = world.players[0, 0].effects[0]
    effect["source"], effect["until_tick"] = names.index("pulse") + 1, loop.session.tick + 120
    effect["speed_scale"], effect["thrust_scale"] = 0.1, pulse.thrust_scale
    effect["grip_scale"] = 1.0
    loop.run(1.5)
    assert loop.unit.hud is not None
    assert len(loop.unit.hud.effects) == 1
    assert loop.plant.body.speed == pytest.approx(0.1 * TT02.top_speed, abs=0.15)
    loop.run(2.0)
    assert loop.plant.body.speed > 1.0


def test_the_reflex_stops_a_plant_before_a_person_with_the_throttle_full() -> None:
    loop = Loop().run(4.0)
    body = loop.plant.body
    angle = math.atan2(body.y, body.x) + 0.6  # 2.4 m on along the ring of 4 m
    person = Person(4.0 * math.cos(angle), 4.0 * math.sin(angle), 0.07)
    loop.around.people.append(person)
    loop.foot_down = True
    loop.run(2.0)
    assert loop.control.throttle == 1.0
    assert abs(body.speed) < 0.02
    assert loop.unit.command.cause & Cause.OBSTACLE
    assert 0.0 < gap_to(person, body) < 1.5
    loop.foot_down = False
    loop.around.people.clear()
    loop.run(UNSEEN_S + 1.0)
    assert body.speed > 0.5


def test_a_plant_whose_link_is_cut_stops_by_itself_and_is_parked() -> None:
    loop = Loop().run(4.0)
    speed, x, y = loop.plant.body.speed, loop.plant.body.x, loop.plant.body.y
    loop.hears = False
    loop.control = Control(loop.control.steering, 1.0)  # the driver's foot stays down
    loop.run(1.5)
    body = loop.plant.body
    assert abs(body.speed) < 0.02
    assert math.hypot(body.x - x, body.y - y) < speed + speed**2 / 3.0
    assert EventKind.FLAG in [event.kind for event in loop.events]
    loop.run(2.5)
    raced = loop.session.world.bodies[0, 0]
    assert raced.trust == Trust.SUSPENDED
    assert raced.status == Status.RACING
    loop.hears = True
    loop.run(2.0)
    assert raced.trust == Trust.TRUSTED
    assert body.speed > 0.5


def test_a_kart_that_hears_nothing_at_all_never_moves() -> None:
    unit = Loop().unit
    unit.drive(Control(0.0, 1.0), 0.0)
    assert unit.decide(0.0).brake == 1.0
