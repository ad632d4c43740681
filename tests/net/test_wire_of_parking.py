"""Messages of a session in a car park: what comes off the network is what was sent."""

from dataclasses import replace

import numpy as np
import pytest

from race_server.core.vehicle_presets import LORRY, TT02
from race_server.errors import WireError
from race_server.net.wire import lobby, parking, spectate
from race_server.net.wire.strict import root_of
from support.messages import (
    COURSE,
    LOT,
    ORDER,
    PARKED,
    STANDINGS,
    WELCOME,
    lot_snapshot,
    same,
    snapshot,
)


def test_a_round_in_a_car_park_comes_back_as_it_was_sent() -> None:
    back = parking.decode_lot(parking.encode_lot(LOT))
    assert (back.epoch, back.tick) == (2, 600)
    assert back.goals.tolist() == LOT.goals.tolist()
    assert back.blocks.tolist() == [(5.0, 2.0, 0.5, 1.5, 1.0, 2, bytes(3))]
    ((seat, points),) = [(way.seat, way.points.tolist()) for way in back.ways]
    assert (seat, points) == (3, [[0.0, 1.0], [2.0, 1.5], [4.0, 2.0]])


def test_a_round_in_which_no_way_is_planned_is_written_as_before_there_were_any() -> None:
    data = parking.encode_lot(replace(LOT, ways=()))
    assert parking.decode_lot(data).ways == ()
    assert root_of(data, b"RLOT", 1 << 17).field(4, 4) == 0


def test_a_way_with_half_a_point_or_too_many_is_refused() -> None:
    for points in (np.zeros((1, 3)), np.zeros((300, 2))):
        way = parking.WayFrame(0, points)
        with pytest.raises(WireError):
            parking.decode_lot(parking.encode_lot(replace(LOT, ways=(way,))))


def same_order(one: parking.OrderFrame, other: parking.OrderFrame) -> bool:
    numbers = (one.epoch, one.sequence) == (other.epoch, other.sequence)
    return numbers and same(one.order, other.order)


def test_an_order_to_park_comes_back_as_it_was_sent_alone_and_in_a_briefing() -> None:
    assert same_order(parking.decode_order(parking.encode_order(ORDER)), ORDER)
    welcome = lobby.decode_welcome(lobby.encode_welcome(replace(WELCOME, order=ORDER)))
    assert welcome.order is not None
    assert same_order(welcome.order, ORDER)
    assert lobby.decode_welcome(lobby.encode_welcome(WELCOME)).order is None


def test_what_an_order_asks_of_trailers_comes_back_as_it_was_sent() -> None:
    level = replace(ORDER.order.level, hitch=0.25, last=True)
    frame = replace(ORDER, order=replace(ORDER.order, level=level))
    assert parking.decode_order(parking.encode_order(frame)).order.level == level


def test_trailers_come_back_as_they_were_sent() -> None:
    rows = np.zeros(2, parking.TRAILER)
    for number, name in enumerate(parking.TRAILER_NAMES):
        rows[name] = np.arange(2) + number
    frame = replace(snapshot(), trailers=rows)
    writer = spectate.SnapshotWriter()
    for _ in range(2):
        assert spectate.decode_snapshot(writer.write(frame)).trailers.tolist() == rows.tolist()


def test_a_briefing_tells_of_trailers_and_feelers() -> None:
    for vehicle in (LORRY, TT02):
        briefing = replace(WELCOME.briefing, vehicle=vehicle)
        back = lobby.decode_welcome(lobby.encode_welcome(replace(WELCOME, briefing=briefing)))
        assert back.briefing.vehicle == vehicle


def test_an_order_whose_walls_are_not_whole_or_not_finite_is_refused() -> None:
    for walls, why in ((np.ones(7), "rows have 4"), (np.array([[np.nan] * 4]), "not finite")):
        bad = replace(ORDER, order=replace(ORDER.order, walls=walls))
        with pytest.raises(WireError, match=why):
            parking.decode_order(parking.encode_order(bad))


def test_people_and_figures_of_parking_come_back_as_they_were_sent() -> None:
    frame = lot_snapshot()
    writer = spectate.SnapshotWriter()
    assert spectate.decode_snapshot(writer.write(snapshot())).walkers.tolist() == []
    back = spectate.decode_snapshot(writer.write(frame))
    assert back.walkers.tolist() == frame.walkers.tolist()
    assert back.trailers.tolist() == []
    table = replace(STANDINGS, rows=(PARKED,))
    assert spectate.decode_standings(spectate.encode_standings(table)).rows == (PARKED,)


def test_slots_of_a_car_park_come_with_its_course() -> None:
    lot = replace(COURSE, slots=np.array([[1.0, 2.0, 0.5, 3.0, 2.0]]))
    assert same(lobby.decode_course(lobby.encode_course(lot)), lot)
