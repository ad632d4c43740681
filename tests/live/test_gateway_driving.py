"""Karts that are driven from browsers: whose hand is on the wheel, and whose seat it is."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Control
from race_server.live.gateway.limits import GatewayTiming
from race_server.net.wire import topics
from race_server.net.wire.drive import ControlFrame, decode_hud, encode_control
from race_server.net.wire.lobby import decode_welcome
from race_server.net.wire.spectate import decode_snapshot
from support.browsers import DRIVE, STEWARD, Browser
from support.served_race import ServedRace, gated, racing, wait_for_race
from support.servers import wait_until

pytestmark = pytest.mark.live

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("private_folders")]

# A page that was silent for this long may be replaced.
STALLED_S = 1.0


@contextmanager
def lobby_with(timing: GatewayTiming) -> Iterator[ServedRace]:
    """Serve a lobby that waits for one driver, and a gateway."""
    address = free_address()
    with racing(address, drivers=1) as server, gated(address, timing=timing) as served:
        served.server = server
        wait_for_race(served)
        yield served


@pytest.fixture
def lobby() -> Iterator[ServedRace]:
    """A lobby that waits for one driver, and a gateway."""
    with lobby_with(GatewayTiming()) as served:
        yield served


def control(sequence: int, throttle: float = 0.3) -> bytes:
    return encode_control(ControlFrame(1, sequence, 1, Control(throttle=throttle)))


def start_driving(driver: Browser) -> None:
    driver.send({"type": "ready", "ready": True})
    assert driver.word("ready")["accepted"]
    driver.until(
        lambda h: isinstance(h, bytes) and h[4:8] == b"RHUD" and not decode_hud(h).lights_s
    )


def own_kart(browser: Browser, seat: int = 1) -> tuple[float, int]:
    """Return speed and the newest number that the server took, as of now."""
    while browser.receive(0.0) is not None:
        pass
    karts = decode_snapshot(browser.frame(b"RSNP")).karts
    row = karts[karts["seat"] == seat]
    return float(row["speed"][0]), int(row["acknowledged"][0])


def test_a_seat_is_driven_from_a_browser_until_the_hand_is_off_the_wheel(lobby: ServedRace) -> None:
    with Browser(lobby.base, {**DRIVE, "rate": 60}) as driver:
        welcome = driver.word("welcome")
        assert (welcome["seat"], welcome["sequence"]) == (1, 0)
        briefing = decode_welcome(driver.frame(b"RBRF"))
        assert (briefing.briefing.seat, briefing.secret) == (1, 0)
        start_driving(driver)
        for sequence in range(1, 41):
            driver.send(control(sequence))
            time.sleep(0.02)
        speed, acknowledged = own_kart(driver)
        assert speed > 0.1
        assert acknowledged >= 38
        assert driver.word("notice") == {"type": "notice", "code": "dead-man"} | {
            "reason": driver.words[-1]["reason"]
        }
        time.sleep(1.5)
        assert own_kart(driver)[0] < speed
        driver.send(control(20))  # a copy counts no more
        driver.send(control(41))
        assert driver.word("notice")["code"] == "driving"
        driver.send({"type": "park", "park": True})
        answer = driver.word("park")
        assert not answer["accepted"]
        assert answer["reason"] == "there is no car park here; serve one with --lot"


def test_a_driver_is_not_disturbed_by_who_stole_its_words_and_comes_back_with_them() -> None:
    with lobby_with(GatewayTiming(stalled_s=STALLED_S)) as lobby:
        drive_with_a_thief(lobby)


def drive_with_a_thief(lobby: ServedRace) -> None:
    with Browser(lobby.base, DRIVE) as driver:
        word = driver.word("welcome")["resume"]
        for stolen in (DRIVE, {"role": "drive", "resume": word}):
            driver.send({"type": "ping", "t": 1})
            with Browser(lobby.base, stolen) as thief:
                assert thief.refusal() == ("used", 4410)
        driver.send({"type": "ping", "t": 2})
        assert driver.word("pong")
    with Browser(lobby.base, {"role": "drive", "resume": word}) as back:
        welcome = back.word("welcome")
        assert welcome["seat"] == 1
        # A page whose network has gone is replaced by one that shows its token.
        time.sleep(1.2 * STALLED_S)
        with Browser(lobby.base, {"role": "drive", "resume": welcome["resume"]}) as again:
            assert again.word("welcome")["seat"] == 1
            assert back.refusal() == ("used", 4410)
            again.send({"type": "leave"})
            while again.receive(2.0) is not None:
                pass
        assert again.socket.close_code == 1000
    assert lobby.server is not None
    assert not lobby.server.session.seats[1].is_taken


def test_who_has_left_comes_back_under_another_name_only_by_the_door(lobby: ServedRace) -> None:
    with Browser(lobby.base, {**DRIVE, "name": "Ada"}) as driver:
        word = driver.word("welcome")["resume"]
        driver.send({"type": "leave"})
        while driver.receive(2.0) is not None:
            pass
    with Browser(lobby.base, {"role": "drive", "resume": word}) as again:
        assert again.refusal() == ("used", 4410)


def test_who_was_ready_is_told_so_after_a_reload_but_not_in_the_next_lobby() -> None:
    address = free_address()
    with racing(address, drivers=2) as server, gated(address) as served:
        served.server = server
        wait_for_race(served)
        wait_until(lambda: served.state.live.view.standings is not None, 10.0)
        with Browser(served.base, DRIVE) as driver:
            welcome = driver.word("welcome")
            assert (welcome["ready"], welcome["park"]) == (False, False)
            driver.send({"type": "ready", "ready": True})
            assert driver.word("ready")["accepted"]
        with Browser(served.base, {"role": "drive", "resume": welcome["resume"]}) as again:
            welcome = again.word("welcome")
            assert (welcome["ready"], welcome["park"]) == (True, False)
        seat, moment = served.state.driver_seats[0], served.state.live.moment
        assert not seat.has_asked(topics.READY, moment._replace(epoch=moment.epoch + 1))


def test_damaged_and_too_many_controls_are_refused(lobby: ServedRace) -> None:
    for data, code in ((control(1, throttle=3.0), "malformed"), (bytes(300), "too-large")):
        with Browser(lobby.base, DRIVE) as driver:
            driver.word("welcome")
            driver.send(data)
            assert driver.refusal()[0] == code
    with Browser(lobby.base, DRIVE) as driver:
        driver.word("welcome")
        for sequence in range(1, 300):
            driver.send(control(sequence))
        assert driver.refusal() == ("too-fast", 4429)


def test_a_driver_protests_once_in_two_seconds_and_drives_on(lobby: ServedRace) -> None:
    with Browser(lobby.base, DRIVE) as driver:
        driver.word("welcome")
        answers = []
        for _ in range(2):
            driver.send({"type": "protest", "against": 0, "why": "cut"})
            answers.append(driver.word("protest"))
        driver.send({"type": "ping", "t": 1})
        driver.word("pong")
    assert [answer["accepted"] for answer in answers] == [False, False]
    assert "protests are for events" in answers[0]["reason"]
    assert answers[1]["reason"] == "more than 0.5 protests a second; send fewer"


def test_a_driver_whose_page_does_not_come_back_loses_its_seat() -> None:
    with lobby_with(GatewayTiming(seat_grace_s=0.2)) as lobby:
        assert lobby.server is not None
        seats = lobby.server.session.seats
        with Browser(lobby.base, DRIVE) as driver:
            driver.word("welcome")
            assert seats[1].is_taken
        deadline = time.monotonic() + 5.0
        while seats[1].is_taken and time.monotonic() < deadline:
            time.sleep(0.02)
        assert not seats[1].is_taken


def test_a_driver_who_is_sent_away_is_told_so() -> None:
    with (
        lobby_with(GatewayTiming(hud_timeout_s=0.3)) as lobby,
        Browser(lobby.base, DRIVE) as driver,
        Browser(lobby.base, STEWARD) as steward,
    ):
        driver.word("welcome")
        steward.send({"type": "act", "act": "kick", "seat": 1, "id": 1})
        assert steward.word("acted")["accepted"]
        assert driver.refusal() == ("seat-lost", 4411)
        assert "closed" in driver.words[-1]["reason"]
