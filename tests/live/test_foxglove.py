"""A race live in Foxglove, received by a WebSocket client of the test."""

import json
import struct
import time
from functools import partial

import pytest

from race_server.competition.launch import free_address
from race_server.live.client.foxglove import FoxgloveServer
from race_server.live.client.seat import insist
from race_server.live.client.spectator import Spectator
from race_server.live.server import REAL, RaceServer
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire.spectate import decode_snapshot
from race_server.scenario.race import Rules, Scenario
from race_server.session.session import Session
from race_server.storage.recording.scene import course_scene
from support.courses import ring
from support.servers import running

pytest.importorskip("foxglove")
client = pytest.importorskip("websockets.sync.client")
pytestmark = pytest.mark.live
MESSAGE = 1  # the operation of a binary message: then subscription, time, data


def test_a_viewer_is_told_the_channels_and_sees_course_and_karts() -> None:
    rules = Rules(laps=1, countdown_s=0.2, limit_s=10.0)
    session = Session("cup", Scenario(ring(4.0, 0.8), karts=1, rules=rules))
    address = free_address()
    with ServerLink(address, "cup", 1, real_time=True) as link:
        server = RaceServer(session, link, REAL, fillers=("pure_pursuit",))
        with running(server), ClientLink(address, "cup") as client_link:
            spectator = insist(partial(Spectator, client_link), time.monotonic() + 60.0)
            with FoxgloveServer(client_link, spectator, "cup", 0) as view:
                assert view.address.startswith("ws://127.0.0.1:")
                entities, tick = _look(view.address)
    assert entities >= {"course", "kart 0"}
    assert tick > 0


def _look(address: str) -> tuple[set[str], int]:
    """Return what is drawn until course and karts were, and the newest tick that was received."""
    with client.connect(address, subprotocols=["foxglove.sdk.v1"]) as viewer:
        channels: dict[str, dict[str, object]] = {}
        while len(channels) < 4:
            message = json.loads(viewer.recv(timeout=5.0))
            channels |= {row["topic"]: row for row in message.get("channels", [])}
        assert channels["race/cup/scene"]["schemaName"] == "foxglove.SceneUpdate"
        snapshots = channels["race/cup/out/snapshot"]
        assert (snapshots["encoding"], snapshots["schemaEncoding"]) == ("flatbuffer",) * 2
        wanted = [
            {"id": number, "channelId": channels[f"race/cup/{key}"]["id"]}
            for number, key in enumerate(("scene", "out/snapshot"))
        ]
        viewer.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        drawn: set[str] = set()
        tick = 0
        while not drawn >= {"course", "kart 0"} or tick == 0:
            data = viewer.recv(timeout=5.0)
            if isinstance(data, str) or data[0] != MESSAGE:
                continue
            subscription, _ = struct.unpack_from("<IQ", data, 1)
            if subscription == 0:
                drawn |= {entity["id"] for entity in json.loads(data[13:])["entities"]}
            else:
                tick = decode_snapshot(data[13:]).tick
        return drawn, tick


def test_the_course_is_drawn_as_pairs_of_points() -> None:
    borders = ring(4.0, 0.8).borders
    (entity,) = json.loads(course_scene(borders, 0))["entities"]
    assert len(entity["lines"][0]["points"]) == 2 * len(borders)
