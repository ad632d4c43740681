"""Real karts among one another, over zenoh on loopback: with a server, and once it is gone."""

import math
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from race_agents.onboard.client import take_part
from race_agents.onboard.grounds import fence_of
from race_agents.onboard.kart import KartHere
from race_agents.onboard.program import KartProgram
from race_agents.onboard.safety_side import Mailboxes, SafetySide
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Surroundings
from race_agents.plant.sensors import Sensors
from race_agents.unit.control_unit import ControlUnit
from race_server.competition.launch import free_address, free_port
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.peer import Peer
from race_server.errors import LinkError
from race_server.live.client.seat import ClientSeat
from race_server.live.server import REAL, RaceServer
from race_server.net.auth.issue import Order, issue_keys
from race_server.net.auth.keys import read_client_keys
from race_server.net.auth.settings import PeerSettings
from race_server.net.transport import ClientLink, PeerLink, ServerLink
from race_server.net.wire.lobby import CourseSheet
from support.servers import running, wait_until
from support.sessions import session_on_ring

pytestmark = pytest.mark.live

# The clocks of two karts.
OFFSETS = 0.0, 500.0


class Gentle:
    """Drives straight on with a light foot."""

    preset = "track"

    def reset(self, briefing: object) -> None:
        pass

    def act(self, seen: Observation) -> Control:
        return Control(0.0, 0.1 if seen.scalar("lights") == 0.0 else 0.0)


class Seen:
    """What two karts hear of each other, by seat, and where they truly are."""

    def __init__(self) -> None:
        self.plants: dict[int, Plant] = {}
        self.heard: dict[int, tuple[Peer, ...]] = {0: (), 1: ()}
        self.ages: dict[int, list[float]] = {0: [], 1: []}
        self.enough = threading.Event()

    def kart_of(self, seat: ClientSeat, sheet: CourseSheet, link: ClientLink) -> KartHere:
        del link
        x, y, heading = (float(value) for value in sheet.grid[seat.number])
        vehicle = seat.welcome.briefing.vehicle
        plant = Plant.of(vehicle, Surroundings(sheet.borders), (x, y, heading), Sensors(), seed=1)
        self.plants[seat.number] = plant
        unit = ControlUnit.of(vehicle, fence_of(sheet))
        return KartHere(SafetySide(unit, plant, Mailboxes.over(bytearray(Mailboxes.size()))))

    def turn(self, onboard: KartProgram, kart: KartHere, now_s: float) -> bool:
        number, peers = onboard.seat.number, kart.side.unit.others.peers
        self.heard[number] = peers
        self.ages[number] += [now_s - 1e-6 * peer.stamp_us for peer in peers]
        return not self.enough.is_set()


def test_two_karts_see_each_other_with_the_race_server_gone() -> None:
    session = session_on_ring("race", karts=2, laps=1, countdown_s=0.5, limit_s=60.0)
    address, places, seen = free_address(), (free_address(), free_address()), Seen()
    drives = [
        threading.Thread(
            target=take_part,
            args=(Gentle(), seen.kart_of),
            kwargs={
                "name": f"real {number}",
                "address": address,
                "wanted": number,
                "peers": (places[number], places[1 - number]),
                "clock": lambda offset_s=OFFSETS[number]: time.monotonic() + offset_s,
                "each_turn": seen.turn,
            },
        )
        for number in (0, 1)
    ]
    with (
        ServerLink(address, "race", 2) as link,
        running(RaceServer(session, link, REAL), drivers=2),
    ):
        for drive in drives:
            drive.start()
        wait_until(lambda: session.tick > 60 and all(seen.heard.values()))
    died_s = time.monotonic()
    for ages in seen.ages.values():
        ages.clear()
    try:
        # No word came for over a second, of a server whose orders hold for half of one.
        wait_until(lambda: time.monotonic() - died_s > 1.5)
        for number, offset_s in enumerate(OFFSETS):
            (peer,) = seen.heard[number]
            assert 1e-6 * peer.stamp_us - offset_s - died_s > 1.0
            body = seen.plants[1 - number].body
            assert math.hypot(peer.x - body.x, peer.y - body.y) < 0.5
            # Fifty a second, on a machine that may be busy; each a few turns old.
            assert len(seen.ages[number]) > 20
            assert sorted(seen.ages[number])[len(seen.ages[number]) // 2] < 0.1
    finally:
        seen.enough.set()
        for drive in drives:
            drive.join(20.0)


def test_a_kart_is_told_nothing_by_a_certificate_of_another_seat_or_session(
    tmp_path: Path,
) -> None:
    pytest.importorskip("cryptography")
    for name in ("own", "foreign"):
        issue_keys(Order("cup", seats=3, hosts=("127.0.0.1",), days=1.0), tmp_path / name)
    place = f"tls/127.0.0.1:{free_port()}"
    heard: set[tuple[int, bytes]] = set()

    def others(folder: str, seat: int, claimed: int) -> PeerLink:
        keys = read_client_keys(tmp_path / folder / f"seat-{seat}")
        own = f"tls/127.0.0.1:{free_port()}"
        return PeerLink(PeerSettings(own, (place,), "cup", claimed, keys), lambda *_: None)

    own = read_client_keys(tmp_path / "own" / "seat-0")
    settings = PeerSettings(place, (), "cup", 0, own)
    with (
        PeerLink(settings, lambda seat, data: heard.add((seat, data))),
        others("own", 1, 1) as honest,
        others("own", 2, 1) as impostor,
        others("foreign", 2, 2) as stranger,
    ):

        def told() -> bool:
            honest.tell(b"honest")
            impostor.tell(b"impostor")
            stranger.tell(b"stranger")
            return (1, b"honest") in heard

        wait_until(told)
        for _ in range(25):  # half a second more
            told()
            time.sleep(0.02)
    assert heard == {(1, b"honest")}


def test_no_client_takes_a_real_kart_for_the_server(tmp_path: Path) -> None:
    pytest.importorskip("cryptography")
    issue_keys(Order("cup", seats=2, hosts=("127.0.0.1",), days=1.0), tmp_path / "keys")
    place = f"tls/127.0.0.1:{free_port()}"
    kart, driver = (read_client_keys(tmp_path / "keys" / f"seat-{seat}") for seat in (0, 1))
    with (
        PeerLink(PeerSettings(place, (), "cup", 0, kart), lambda *_: None),
        pytest.raises(LinkError),
        ClientLink(place, "cup", keys=driver, timeout_s=1.0),
    ):
        pass


def test_a_kart_hears_at_most_a_hundred_messages_a_second_of_another_one() -> None:
    places, heard = (free_address(), free_address()), []
    first = PeerSettings(places[0], places[1:], "cup", 0)
    with (
        PeerLink(first, lambda *told: heard.append(told)),
        PeerLink(replace(first, address=places[1], others=places[:1], seat=1), print) as flood,
    ):
        wait_until(lambda: flood.tell(b"first") or heard)
        begun_s = time.monotonic()
        for _ in range(3000):
            flood.tell(b"flood")
        flood.tell(bytes(1000))
        wait_until(lambda: time.monotonic() - begun_s > 1.0)
        lasted_s = time.monotonic() - begun_s
    assert len(heard) < 100 * (lasted_s + 1.0)
    assert max(len(data) for _, data in heard) == 5
