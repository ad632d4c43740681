"""Browsers beside the driver of a seat that another program holds, such as that of a real kart."""

from collections.abc import Iterator

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Control
from race_server.errors import GatewayError
from race_server.live.gateway.handshake import Role, read_hello
from race_server.live.gateway.roles import Identity, Tokens
from race_server.live.gateway.settings import tokens_for
from race_server.net.wire.drive import ControlFrame, decode_hud, encode_control
from support.browsers import DRIVE, Browser
from support.served_race import ServedRace, gated, racing, wait_for_race

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("private_folders")]

TOKENS = Tokens(
    drive=("drive one",), steward="steward one", companion=((0, "beside 0"), (1, "beside 1"))
)
BESIDE_0, BESIDE_1 = ({"role": "companion", "token": f"beside {seat}"} for seat in (0, 1))


@pytest.fixture(scope="module")
def served(private_folders: None) -> Iterator[ServedRace]:
    """A lobby that waits for one driver, and a gateway with companions of both seats."""
    address = free_address()
    with racing(address, drivers=1) as server, gated(address, tokens=TOKENS) as served:
        served.server = server
        wait_for_race(served)
        yield served


def test_a_companion_sees_what_the_driver_of_its_seat_must_see(served: ServedRace) -> None:
    with (
        Browser(served.base, DRIVE) as driver,  # takes seat 1
        Browser(served.base, BESIDE_1) as beside,
        Browser(served.base, BESIDE_0) as elsewhere,
    ):
        assert driver.word("welcome")["seat"] == 1
        assert beside.word("welcome")["seat"] == 1
        driver.send({"type": "ready", "ready": True})
        seen = [decode_hud(browser.frame(b"RHUD")) for browser in (driver, beside)]
        assert abs(seen[0].tick - seen[1].tick) < 60
        assert seen[0].epoch == seen[1].epoch
        beside.frame(b"RSNP")
        for _ in range(60):
            elsewhere.frame(b"RSNP")  # sees the race, but nothing that is meant for seat 1
        assert not [data for data in elsewhere.frames if data[4:8] == b"RHUD"]


def test_a_companion_cannot_drive(served: ServedRace) -> None:
    with Browser(served.base, BESIDE_1) as beside:
        beside.word("welcome")
        beside.send(encode_control(ControlFrame(1, 1, 1, Control(throttle=1.0))))
        assert beside.refusal() == ("malformed", 4400)


def test_a_companion_uses_the_item_of_its_kart_and_nothing_where_it_holds_none(
    served: ServedRace,
) -> None:
    assert served.server is not None
    player = served.server.session.world.players[0]
    with Browser(served.base, DRIVE) as driver, Browser(served.base, BESIDE_1) as beside:
        driver.send({"type": "ready", "ready": True})
        beside.frame(b"RHUD")
        player["held"][1] = 0
        beside.send({"type": "use"})
        answer = beside.word("use")
        assert answer["reason"] == "the kart of seat 1 holds no item"
        used = int(player["items_used"][1])
        player["held"][1] = 1
        for _ in range(600):  # a kart uses nothing before the start
            if player["items_used"][1] == used + 1:
                break
            player["held"][1] = 1
            beside.send({"type": "use"})
            assert beside.word("use")["accepted"]
            beside.frame(b"RSNP")
        assert player["items_used"][1] == used + 1


@pytest.mark.parametrize("kind", ["ready", "leave", "act"])
def test_a_companion_asks_for_nothing_in_the_name_of_its_driver(
    served: ServedRace, kind: str
) -> None:
    words = {"ready": True, "act": "flag", "seat": -1, "value": 2, "id": 1}
    with Browser(served.base, BESIDE_1) as beside:
        beside.word("welcome")
        beside.send({"type": kind, **words})
        assert beside.refusal() == ("malformed", 4400)


def test_a_stolen_token_of_a_companion_opens_nothing_else() -> None:
    assert TOKENS.identify(read_hello('{"role": "companion", "token": "beside 1"}')) == Identity(
        Role.COMPANION, 1
    )
    for role in ("drive", "steward"):
        with pytest.raises(GatewayError):
            TOKENS.identify(read_hello(f'{{"role": "{role}", "token": "beside 1"}}'))
    for token in ("", "drive one", "steward one", "beside"):
        with pytest.raises(GatewayError):
            TOKENS.identify(read_hello(f'{{"role": "companion", "token": "{token}"}}'))


def test_each_seat_has_one_token_however_often_it_is_named() -> None:
    tokens = tokens_for(drivers=0, steward=False, open_to_all=True, companions=(3, 1, 3))
    assert [seat for seat, _ in tokens.companion] == [1, 3]
    assert len({token for _, token in tokens.companion}) == 2
