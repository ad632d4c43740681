"""What comes off the network is what was sent."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from race_server.core.alert import Alert
from race_server.core.messages import Button, Control, Flag, Phase, Pose, Source, Standing
from race_server.core.telemetry import Telemetry
from race_server.errors import SeatError, WireError
from race_server.net.wire import (
    admin,
    drive,
    ghosts,
    line,
    links,
    lobby,
    peer,
    rays,
    spectate,
    telemetry,
)
from race_server.net.wire import alert as alerts
from race_server.net.wire import pose as poses
from support.messages import (
    COURSE,
    EVENTS,
    GHOST,
    HUD,
    LINE,
    LINKS,
    PARKED,
    PEER,
    RAYS,
    STANDINGS,
    TELEMETRY,
    TIMED,
    WELCOME,
    same,
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


def test_standings_of_a_course_with_the_longest_name_of_a_file_come_back() -> None:
    table = replace(STANDINGS, course="é" * 127 + "-reversed")
    assert spectate.decode_standings(spectate.encode_standings(table)) == table
    with pytest.raises(WireError, match="at most 320 are allowed"):
        spectate.decode_standings(spectate.encode_standings(replace(table, course="x" * 321)))


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
    "name",
    [
        *("", "\x1b[2J", "a\nb", "\x9b", "\u202ea", "\u2066a", "\x00", "a\u2028"),
        *(
            " ",
            "Anna ",
            " Anna",
            "\u3164",
            "\u2800",
            "Anna\u034f",
            "\ufe0f",
            "\U000e0100",
            "\u0301",
        ),
    ],
)
def test_a_name_that_cannot_be_seen_is_refused(name: str) -> None:
    with pytest.raises(WireError, match="use 1 to 32 printable characters"):
        lobby.decode_join(lobby.encode_join(lobby.Join(name, "lidar")))


def test_what_cannot_be_seen_in_a_name_is_named() -> None:
    with pytest.raises(WireError, match=r"has U\+034F, which cannot be seen: use 1 to 32"):
        lobby.decode_join(lobby.encode_join(lobby.Join("Anna\u034f", "lidar")))
    with pytest.raises(WireError, match="name 'Anna ' has a space at one end: use 1 to 32"):
        lobby.decode_join(lobby.encode_join(lobby.Join("Anna ", "lidar")))


@pytest.mark.parametrize("name", ["Anna B", "7", "+", "é", "e\u0301", "名", "🏎", "שלום"])
def test_a_name_with_something_to_see_is_taken(name: str) -> None:
    assert lobby.decode_join(lobby.encode_join(lobby.Join(name, "lidar"))).driver == name


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


def test_a_course_comes_back_as_it_was_sent() -> None:
    assert same(lobby.decode_course(lobby.encode_course(COURSE)), COURSE)


@pytest.mark.parametrize("name", ["line", "borders"])
def test_a_course_with_a_place_that_is_no_number_is_refused(name: str) -> None:
    array = getattr(COURSE, name).copy()
    array[0, 0] = np.nan
    with pytest.raises(WireError, match=f"{name} of a course are not all finite"):
        lobby.decode_course(lobby.encode_course(replace(COURSE, **{name: array})))


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


def test_rays_come_back_as_they_were_sent() -> None:
    assert same(decode_rays(rays.encode_rays(RAYS)), RAYS)


def test_a_ghost_comes_back_as_it_was_sent() -> None:
    epoch, (back,) = ghosts.decode_ghosts(ghosts.encode_ghosts(4, (GHOST,)))
    assert epoch == 4
    assert same(back, GHOST)


def test_what_is_not_there_is_told_as_infinitely_far() -> None:
    nothing = alerts.AlertFrame(1, 1, Alert(5))
    assert alerts.decode_alert(alerts.encode_alert(nothing)) == nothing


@pytest.mark.parametrize("told", [TELEMETRY, Telemetry(99)])
def test_telemetry_comes_back_as_it_was_sent_known_or_not(told: Telemetry) -> None:
    frame = telemetry.TelemetryFrame(4, 9, told)
    assert telemetry.decode_telemetry(telemetry.encode_telemetry(frame)) == frame
    sent = telemetry.TelemetriesFrame(4, 600, {3: told, 5: told})
    back = telemetry.decode_telemetries(telemetry.encode_telemetries(sent))
    assert dict(back.karts) == {seat: replace(told, stamp_us=0) for seat in (3, 5)}


def test_what_a_kart_tells_the_others_comes_back_as_it_was_sent() -> None:
    assert peer.decode_peer(peer.encode_peer(PEER)) == PEER


@pytest.mark.parametrize(
    "wrong",
    [
        {"x": math.nan},
        {"speed": math.inf},
        {"yaw_rate": 101.0},
        {"braking": -1.0},
        {"deviation": -0.5},
        {"length": 51.0},
    ],
)
def test_a_peer_that_no_kart_can_be_is_refused(wrong: dict[str, float]) -> None:
    frame = replace(PEER, peer=replace(PEER.peer, **wrong))
    with pytest.raises(WireError, match="peer out of range"):
        peer.decode_peer(peer.encode_peer(frame))


def test_telemetry_of_unknown_states_is_refused() -> None:
    frame = telemetry.TelemetryFrame(4, 9, Telemetry(99))
    data = bytearray(telemetry.encode_telemetry(frame))
    data[-8:-4] = (5 << 28).to_bytes(4, "little")  # no sensor has a fifth way to fail
    with pytest.raises(WireError, match="unknown codes"):
        telemetry.decode_telemetry(bytes(data))
