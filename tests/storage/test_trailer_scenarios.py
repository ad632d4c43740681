"""What recordings and spectators keep of vehicles with trailers."""

import json
import math

import numpy as np
import pytest

from race_server.core.vehicle_presets import LORRY, TT02
from race_server.live.server.publisher import snapshot_of
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import Scenario
from race_server.scenario.track.lot import Lot
from race_server.session.session import Session
from race_server.storage.recording.scenario_codec import pack_scenario, unpack_scenario


def lot_of(scenario: Scenario) -> Lot:
    assert scenario.course.lot is not None
    return scenario.course.lot


def test_a_scenario_with_a_lorry_comes_back_as_it_was_recorded() -> None:
    scenario = parking_scenario("dock-35", level="dock")
    back = unpack_scenario(*pack_scenario(scenario))
    assert back.vehicles == (LORRY,)
    assert back.level == scenario.level
    assert lot_of(back).zones == lot_of(scenario).zones
    assert lot_of(unpack_scenario(*pack_scenario(parking_scenario("grid-150")))).from_slots


def test_a_scenario_from_before_there_were_trailers_is_read_as_without() -> None:
    scenario = parking_scenario("yard-70", vehicle="tt02")
    text, arrays = pack_scenario(scenario)
    words = json.loads(text)
    for vehicle in words["vehicles"]:
        del vehicle["trailers"], vehicle["feelers"]
    del words["level"]["hitch"], words["level"]["last"], words["course"]["lot"]["from_slots"]
    for zone in words["course"]["lot"]["zones"]:
        del zone["hitch"]
    back = unpack_scenario(json.dumps(words), arrays)
    assert back.vehicles == (TT02,)
    assert back.level == scenario.level


def test_a_snapshot_has_the_box_of_each_trailer_and_none_of_a_kart() -> None:
    session = Session("lot", parking_scenario("dock-35"))
    session.world.bodies[0, 0].x, session.world.bodies[0, 0].y = 30.0, 27.0
    session.world.bodies[0, 0].heading = 0.0
    session.world.bodies["trailers"]["heading"][0, 0] = 0.5 * math.pi
    (trailer,) = snapshot_of(session).trailers
    # The hitch is 1.25 m behind the centre of gravity, the middle of the box 5.20 m behind it.
    place = [float(trailer[name]) for name in ("x", "y", "heading")]
    assert place == pytest.approx([30.0 - 1.25, 27.0 - 5.20, 0.5 * math.pi], abs=1e-5)
    assert (trailer["length"], trailer["width"]) == pytest.approx((13.6, 2.55))
    assert (trailer["seat"], trailer["limit"]) == (0, np.float32(0.5 * math.pi))
    assert len(snapshot_of(Session("lot", parking_scenario("yard-70"))).trailers) == 0
