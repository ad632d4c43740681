"""Laps put together from events, and whether they were clean."""

import numpy as np
import pytest

from race_server.core.messages import Cleanness, Control, Event, EventKind
from race_server.errors import WireError
from race_server.net.wire.spectate import decode_events, encode_events
from race_server.session.lap_log import Lap, LapLog
from support.sessions import session_on_ring


def lap_event(sequence: int, kart: int, number: int, detail: int) -> Event:
    return Event(sequence, 600, EventKind.LAP, kart, number, 9_000_000, detail)


def sector_event(sequence: int, kart: int, sector: int) -> Event:
    return Event(sequence, 600, EventKind.SECTOR, kart, sector, 1_000_000 * sector)


def test_a_lap_holds_the_sectors_of_its_own_kart_since_the_lap_before() -> None:
    log = LapLog()
    events = [
        sector_event(1, 0, 1),
        sector_event(2, 4, 1),
        sector_event(3, 0, 2),
        lap_event(4, 0, 1, Cleanness.CLEAN),
        sector_event(5, 0, 1),
        lap_event(6, 0, 2, Cleanness.UNCLEAN),
    ]
    assert [lap for event in events if (lap := log.add(event))] == [
        Lap(0, 1, 9_000_000, (1_000_000, 2_000_000), True, 600),
        Lap(0, 2, 9_000_000, (1_000_000,), False, 600),
    ]
    assert [lap.number for lap in log.laps_in(events[:4])] == [1]
    assert log.times_us == {0: [9_000_000, 9_000_000]}


def test_a_race_that_begins_knows_no_laps_or_sectors_of_the_one_before() -> None:
    log = LapLog()
    log.add(sector_event(1, 0, 1))
    log.add(lap_event(2, 1, 1, Cleanness.CLEAN))
    log.begin(2)
    assert log.times_us == {0: [], 1: []}
    lap = log.add(lap_event(1, 0, 1, Cleanness.CLEAN))
    assert lap is not None
    assert lap.sectors == ()


def test_a_lap_with_a_wall_contact_is_unclean_and_the_next_one_clean_again() -> None:
    session = session_on_ring("test", karts=8, laps=3, countdown_s=0.1)
    session.join("driver", "track")
    session.start()
    racer, events = session.world.racers[0, 0], list[Event]()
    for decision in range(1, 1201):
        wanted = 0.044 - 0.5 * racer.lateral_offset - racer.heading_error
        # In the second lap, for half a second: into the outer wall.
        is_astray = racer.laps == 1 and 5.0 < racer.progress < 6.5
        steering = -1.0 if is_astray else float(np.clip(wanted / 0.314, -1.0, 1.0))
        session.receive_control(0, 1, decision, session.tick, Control(steering, 0.5))
        events += session.advance(3)
        if not session.is_on:
            break
    laps = session.event_log.laps.laps_in(events)
    walls = [event.tick for event in events if event.kind is EventKind.CONTACT_WALL]
    assert [lap.is_clean for lap in laps] == [True, False, True]
    assert all(laps[0].tick < tick < laps[1].tick for tick in walls)
    assert walls
    assert all(sum(lap.sectors) == lap.time_us for lap in laps)


def test_events_of_an_older_server_tell_nothing_of_cleanness() -> None:
    told = [lap_event(1, 0, 1, Cleanness.UNKNOWN), lap_event(2, 0, 2, Cleanness.UNCLEAN)]
    assert decode_events(encode_events(1, told)) == (1, told)
    # Without details the message is the one that older servers send.
    old, new = encode_events(1, told[:1]), encode_events(1, told[1:])
    assert len(old) < len(new)
    assert decode_events(old)[1][0].detail == Cleanness.UNKNOWN


def test_details_of_other_events_than_there_are_are_refused() -> None:
    data = bytearray(encode_events(1, [lap_event(1, 0, 1, Cleanness.UNCLEAN)]))
    place = data.index((1).to_bytes(4, "little") + bytes([Cleanness.UNCLEAN]))
    data[place] = 2
    with pytest.raises(WireError, match="2 details of 1 events"):
        decode_events(bytes(data))
