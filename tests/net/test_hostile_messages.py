"""Damaged, crafted and foreign messages give one kind of error."""

import math
import random
import struct
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from race_server.core.alert import Alert, Danger
from race_server.core.messages import Control, Pose
from race_server.errors import SeatError, WireError
from race_server.net.wire import alert as alerts
from race_server.net.wire import (
    drive,
    ghosts,
    hint,
    line,
    links,
    lobby,
    parking,
    peer,
    programme,
    rays,
    spectate,
    topics,
)
from race_server.net.wire import pose as poses
from race_server.net.wire.strict import root_of
from support.messages import (
    COURSE,
    EVENTS,
    GHOST,
    HINT,
    HUD,
    LINE,
    LINKS,
    LOT,
    ORDER,
    PEER,
    PROGRAMME,
    RAYS,
    STANDINGS,
    TIMED,
    WELCOME,
    snapshot,
)
from support.rays import decode_rays

MESSAGES = [
    (drive.decode_control, drive.encode_control(drive.ControlFrame(1, 2, 3, Control(0.5)))),
    (poses.decode_pose, poses.encode_pose(poses.PoseFrame(1, 2, 3, Pose(4, 5.0, 6.0, 0.7, 8.0)))),
    (drive.decode_observation, drive.ObservationWriter(40).write(1, 2, 3, 4, np.ones(40, "f4"))),
    (drive.decode_hud, drive.encode_hud(HUD)),
    (spectate.decode_snapshot, spectate.SnapshotWriter().write(snapshot())),
    (spectate.decode_events, spectate.encode_events(5, EVENTS)),
    (spectate.decode_standings, spectate.encode_standings(STANDINGS)),
    (spectate.decode_standings, spectate.encode_standings(replace(STANDINGS, rows=(TIMED,)))),
    (lobby.decode_welcome, lobby.encode_welcome(WELCOME)),
    (lobby.decode_join, lobby.encode_join(lobby.Join("Ada", "lidar"))),
    (lobby.decode_seat_act, lobby.encode_seat_act(lobby.SeatAct(1, 2))),
    (lobby.decode_rules, lobby.encode_rules({"laps": "3"}, ["oil"])),
    (lobby.decode_course, lobby.encode_course(COURSE)),
    (line.decode_line, line.encode_line(LINE)),
    (links.decode_links, links.encode_links(LINKS)),
    (parking.decode_lot, parking.encode_lot(LOT)),
    (parking.decode_order, parking.encode_order(ORDER)),
    (peer.decode_peer, peer.encode_peer(PEER)),
    (hint.decode_hint, hint.encode_hint(4, HINT)),
    (decode_rays, rays.encode_rays(RAYS)),
    (programme.decode_programme, programme.encode_programme(PROGRAMME)),
    (ghosts.decode_ghosts, ghosts.encode_ghosts(4, (GHOST,))),
]


HOSTILE = [0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFF0]


def damaged(message: bytes, rng: random.Random) -> bytes:
    """Return a message with flipped bits, hostile words, or cut short."""
    data = bytearray(message)
    for _ in range(rng.randint(1, 3)):
        place = rng.randrange(len(data))
        kind = rng.randrange(3)
        if kind == 0:
            data[place] ^= 1 << rng.randrange(8)
        elif kind == 1 and len(data) >= 8:
            struct.pack_into("<I", data, min(place & ~3, len(data) - 4), rng.choice(HOSTILE))
        else:
            data = data[: max(place, 1)]
    return bytes(data)


@pytest.mark.parametrize(
    ("decode", "message"), MESSAGES, ids=[decode.__name__ for decode, _ in MESSAGES]
)
def test_a_damaged_message_gives_a_value_or_one_kind_of_error(
    decode: Callable[[bytes], object], message: bytes
) -> None:
    rng = random.Random(7)
    refused = 0
    for _ in range(3000):
        try:
            decode(damaged(message, rng))
        except (WireError, SeatError):
            refused += 1
    assert 0 < refused < 3000


@given(st.binary(max_size=300))
def test_bytes_that_are_no_message_are_refused(data: bytes) -> None:
    with pytest.raises(WireError):
        drive.decode_control(data)


@pytest.mark.parametrize(
    "control",
    [
        Control(1.5),
        Control(0, -2.0),
        Control(0, 0, 1.1),
        Control(float("nan")),
        Control(0, 0, -0.1),
    ],
)
def test_a_control_out_of_range_is_refused(control: Control) -> None:
    with pytest.raises(WireError, match="out of range"):
        drive.decode_control(drive.encode_control(drive.ControlFrame(1, 1, 1, control)))


def test_an_oversized_message_is_refused_unread() -> None:
    with pytest.raises(WireError, match="257 bytes; at most 256 are allowed"):
        drive.decode_control(bytes(257))


def test_a_foreign_message_is_refused() -> None:
    with pytest.raises(WireError, match="expected b'RCTL'"):
        drive.decode_control(spectate.encode_events(1, []))


def test_a_vector_that_claims_four_billion_items_is_refused() -> None:
    data = bytearray(spectate.encode_events(5, EVENTS))
    table = root_of(bytes(data), topics.EVENTS.identifier, 4096)
    first, _ = table.vector(1, spectate.EVENT.itemsize, 10)
    struct.pack_into("<I", data, first - 4, 0xFFFFFFFF)
    with pytest.raises(WireError, match="4294967295 items"):
        spectate.decode_events(bytes(data))


@pytest.mark.parametrize("bearing", [math.nan, 4.0])
def test_an_alert_out_of_range_is_refused(bearing: float) -> None:
    seen = alerts.AlertFrame(1, 1, Alert(5, Danger(bearing=bearing)))
    with pytest.raises(WireError, match="out of range"):
        alerts.decode_alert(alerts.encode_alert(seen))
