"""Browsers of a live race: which are admitted, what is sent, and that none disturbs others."""

import json
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Flag
from race_server.errors import GatewayError
from race_server.live.gateway.limits import GatewayLimits, GatewayTiming
from race_server.net.wire.links import decode_links
from race_server.net.wire.lobby import decode_course
from race_server.net.wire.spectate import decode_events, decode_snapshot
from support.browsers import DRIVE, STEWARD, WATCH, Browser
from support.rays import decode_rays
from support.served_race import ORIGIN, TOKENS, ServedRace, ask, gated, racing, wait_for_race
from support.servers import wait_until

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("private_folders")]


def test_a_spectator_is_told_the_course_first_and_then_the_race_as_it_goes(
    served: ServedRace,
) -> None:
    with Browser(served.base, WATCH) as browser:
        welcome = browser.word("welcome")
        assert (welcome["role"], welcome["session"]) == ("spectate", "race")
        assert decode_course(browser.frame(b"RCRS")).name == "ring"
        first = decode_snapshot(browser.frame(b"RSNP"))
        assert [frame[4:8] for frame in browser.frames[:3]] == [b"RCRS", b"RRUL", b"RLIN"]
        second = decode_snapshot(browser.frame(b"RSNP"))
        assert len(second.karts) == 2
        assert second.tick > first.tick
        links = decode_links(browser.frame(b"RLNK")).links
        assert set(links["seat"]) == {0, 1}
        assert (links["age"] < 500).all()


def test_a_late_spectator_is_told_all_events_of_the_race(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        _, events = decode_events(browser.frame(b"REVT"))
    assert events[0].sequence == 1


def test_other_programs_read_the_timing_as_json(served: ServedRace) -> None:
    wait_until(lambda: ask(served, "timing")[0] == 200)
    status, _, body = ask(served, "timing")
    table = json.loads(body)
    assert (status, table["course"], len(table["rows"])) == (200, "ring", 2)
    first = min(table["rows"], key=lambda row: row["rank"])
    assert (first["gap_us"], first["timing"]["interval_us"]) == (0, 0)
    assert len(first["timing"]["mini_merits"]) == 20
    results = json.loads(ask(served, "results.json")[2])
    assert (results["race"]["course"], results["event"]) == (table["course"], None)


def test_a_spectator_gets_as_many_snapshots_as_it_wants(served: ServedRace) -> None:
    with Browser(served.base, {**WATCH, "rate": 10}) as browser:
        ticks = [decode_snapshot(browser.frame(b"RSNP")).tick for _ in range(6)]
        assert ticks[5] - ticks[1] == pytest.approx(24, abs=2)
        browser.send({"type": "rate", "rate": 30})
        for _ in range(3):
            browser.frame(b"RSNP")
        ticks = [decode_snapshot(browser.frame(b"RSNP")).tick for _ in range(6)]
        assert ticks[5] - ticks[0] == pytest.approx(10, abs=2)


def test_a_ping_comes_back_with_the_clock_of_the_server(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        browser.frame(b"RSNP")
        browser.send({"type": "ping", "t": 12.5})
        pong = browser.word("pong")
        assert pong["t"] == 12.5
        # On one machine both read the same clock.
        assert pong["server_us"] == pytest.approx(time.monotonic_ns() / 1000, abs=500_000)


def test_rays_come_of_the_kart_that_is_followed_while_they_are_wanted(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        browser.send({"type": "follow", "seat": 1, "rays": True})
        rays = decode_rays(browser.frame(b"RRAY"))
        assert rays.seat == 1
        assert len(rays.lidar) == 201
        assert 0.0 < rays.lidar.min() < 1.4  # no further from a border than the track is wide
        browser.send({"type": "follow", "seat": -1, "rays": False})
        browser.frame(b"RSTD")
        browser.frames.clear()
        browser.frame(b"RSTD")
        assert b"RRAY" not in [frame[4:8] for frame in browser.frames]


REFUSALS = [
    ({"role": "steward", "token": "wrong"}, "token", 4401),
    ({"role": "drive", "token": ""}, "token", 4401),
    ({"role": "king"}, "malformed", 4400),
    ("not json", "malformed", 4400),
    ("[" * 1000, "malformed", 4400),
    (b"\0\1\2\3", "malformed", 4400),
    ({**WATCH, "rate": "often"}, "malformed", 4400),
    ({**WATCH, "name": "x" * 2000}, "too-large", 4413),
    ({**WATCH, "resume": "never issued"}, "used", 4410),
    ({**WATCH, "source": "recording:../race"}, "no-recording", 4404),
    ({**DRIVE, "seat": 0}, "seat-taken", 4409),
]


@pytest.mark.parametrize(("hello", "code", "closes"), REFUSALS)
def test_a_wrong_hello_is_refused_with_a_word_and_a_sentence(
    served: ServedRace, hello: dict[str, object] | str | bytes, code: str, closes: int
) -> None:
    with Browser(served.base, hello) as browser:
        assert browser.refusal() == (code, closes)
        assert len(browser.words[-1]["reason"]) > 10


def test_who_says_nothing_is_refused(served: ServedRace) -> None:
    with (
        gated(served.address, timing=GatewayTiming(hello_s=0.2)) as impatient,
        Browser(impatient.base) as browser,
    ):
        assert browser.refusal() == ("late", 4408)


def test_pages_from_elsewhere_are_refused_and_named_ones_are_not(served: ServedRace) -> None:
    with Browser(served.base, WATCH, origin="https://evil.example") as browser:
        assert browser.refusal() == ("origin", 4403)
    for origin in (ORIGIN, served.base.rstrip("/")):
        with Browser(served.base, WATCH, origin=origin) as browser:
            browser.word("welcome")


def test_who_does_not_speak_the_subprotocol_is_refused(served: ServedRace) -> None:
    with Browser(served.base, WATCH, subprotocols=None) as browser:
        assert browser.refusal() == ("malformed", 4400)


def test_a_full_gateway_refuses_the_next(served: ServedRace) -> None:
    limits = GatewayLimits(browsers=1)
    with gated(served.address, limits=limits) as small, Browser(small.base, WATCH) as first:
        first.word("welcome")
        with Browser(small.base, WATCH) as second:
            assert second.refusal() == ("full", 4430)
        assert first.frame(b"RSNP")


class Stub:
    """A browser that is there and does nothing."""

    def __init__(self) -> None:
        self.outbox = self

    def check(self) -> None:
        pass


def test_one_address_has_room_for_some_browsers_and_this_machine_for_more(
    served: ServedRace,
) -> None:
    browsers = [(Stub(), host) for host in ("192.0.2.1", "127.0.0.1") for _ in range(16)]
    try:
        for browser, host in browsers:
            served.state.admit(browser, host)
        with pytest.raises(GatewayError, match="of your address"):
            served.state.admit(Stub(), "192.0.2.1")
        served.state.admit(late := Stub(), "127.0.0.1")
        browsers.append((late, "127.0.0.1"))
    finally:
        for browser, host in browsers:
            served.state.remove(browser, host)


def test_a_word_for_coming_back_is_good_for_one_time(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        word = browser.word("welcome")["resume"]
    with Browser(served.base, {"resume": word}) as again:
        assert again.word("welcome")["resume"] != word
        with Browser(served.base, {"resume": word}) as thief:
            assert thief.refusal() == ("used", 4410)
        assert again.frame(b"RSNP")


def test_a_steward_shows_a_flag_and_reads_the_log(served: ServedRace) -> None:
    assert served.server is not None
    with Browser(served.base, STEWARD) as steward:
        assert "flag" in steward.word("welcome")["may"]
        steward.send({"type": "act", "act": "flag", "seat": -1, "value": 1, "id": 7})
        assert steward.word("acted") == {"type": "acted", "id": 7, "accepted": True, "reason": ""}
        assert steward.until(
            lambda message: (
                message[4:8] == b"RSNP" and decode_snapshot(message).flag is Flag.YELLOW
                if isinstance(message, bytes)
                else False
            )
        )
        steward.send({"type": "act", "act": "flag", "value": 0, "id": 8})
        assert steward.word("acted")["accepted"]
        steward.send({"type": "act", "act": "penalty", "seat": 1, "value": 1e5, "id": 9})
        assert "600 s" in steward.word("acted")["reason"]
        steward.send({"type": "act", "act": "explode", "id": 10})
        assert not steward.word("acted")["accepted"]
        steward.send({"type": "log"})
        assert "Eve: yellow flag" in steward.word("log")["lines"][0]


def test_a_spectator_cannot_act(served: ServedRace) -> None:
    with Browser(served.base, WATCH) as browser:
        browser.send({"type": "act", "act": "flag", "value": 2, "id": 1})
        assert browser.refusal() == ("malformed", 4400)


def test_all_answers_carry_the_headers_that_keep_a_page_to_itself(served: ServedRace) -> None:
    for path, expected in (("", 200), ("healthz", 200), ("assets/none.js", 404), ("etc", 404)):
        status, headers, _ = ask(served, path)
        assert status == expected
        assert headers["content-security-policy"].startswith("default-src 'self';")
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
    assert "browsers" in ask(served, "healthz")[2]


def test_nobody_calls_a_local_gateway_by_a_foreign_name(served: ServedRace) -> None:
    assert ask(served, "recordings", Host="evil.example")[0] == 403
    assert ask(served, "recordings", Host="race.example")[0] == 200


# Servers that come and go


def test_browsers_wait_for_a_race_and_go_on_with_the_next_one() -> None:
    address = free_address()
    with gated(address) as served, Browser(served.base, WATCH) as browser:
        assert browser.word("notice")["code"] == "no-race"
        with Browser(served.base, DRIVE) as driver:
            assert driver.refusal() == ("no-race", 4503)
        for _ in range(2):
            with racing(address):
                assert browser.word("notice")["code"] == "race"
                assert browser.frame(b"RSNP")
            assert browser.word("notice")["code"] == "no-race"
        assert decode_course(next(f for f in browser.frames if f[4:8] == b"RCRS")).name == "ring"


def test_a_gateway_for_one_race_ends_with_it() -> None:
    address = free_address()
    with gated(address, once=True, timing=GatewayTiming(race_gone_s=0.3)) as served:
        with racing(address):
            wait_for_race(served)
        served.thread.join(10.0)
        assert not served.thread.is_alive()


def test_with_a_token_for_spectators_nobody_else_watches_or_reads_the_list() -> None:
    tokens = replace(TOKENS, spectate="watch one")
    with gated(free_address(), tokens=tokens) as served:
        with Browser(served.base, WATCH) as browser:
            assert browser.refusal() == ("token", 4401)
        with Browser(served.base, {**WATCH, "token": "watch one"}) as browser:
            browser.word("welcome")
        assert ask(served, "recordings")[0] == ask(served, "timing")[0] == 401
        assert json.loads(ask(served, "recordings", Authorization="Bearer watch one")[2]) == []


def test_the_command_prints_addresses_and_ends_when_it_is_told_to() -> None:
    command = [sys.executable, "-m", "race_server", "gateway", "--connect", free_address()]
    command += ["--port", "0", "--drivers", "1", "--recordings", "none", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        addresses = json.loads(process.stdout.readline())
        assert addresses["watch"].endswith("/#watch")
        drive, _, token = addresses["drive"][0].partition("#drive&token=")
        with Browser(drive, {"role": "drive", "token": token}) as driver:
            assert driver.refusal()[0] == "no-race"
        process.terminate()
        assert process.wait(10.0) == 0


def test_a_gateway_never_imports_numba() -> None:
    code = (
        "import os, sys; os.environ['RACE_SERVER_INTERPRET'] = '1';"
        "import race_server.live.gateway.service, race_server.scenario.race;"
        "sys.exit('numba' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
