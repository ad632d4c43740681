"""Who may do what at a gateway: hellos, tokens, origins and addresses."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.errors import GatewayError, KeysError, LinkError
from race_server.live.gateway.handshake import Role, read_hello, refusal_text
from race_server.live.gateway.key_ring import KeyRing
from race_server.live.gateway.origins import check_origin, is_known_host
from race_server.live.gateway.requests import read_request
from race_server.live.gateway.roles import Identity, ResumeTokens, Tokens
from race_server.live.gateway.settings import Settings, addresses_of, check_settings, place_of


def test_a_hello_without_words_is_that_of_a_spectator() -> None:
    hello = read_hello("{}")
    assert (hello.role, hello.source, hello.seat, hello.rate) == (Role.SPECTATE, "live", -1, 30.0)
    assert [read_hello(f'{{"name": "{name}"}}').name for name in ("", " ", " Ada ")] == [
        "",
        "",
        "Ada",
    ]


@pytest.mark.parametrize(
    "words",
    [
        [],
        {"seat": 64},
        {"seat": True},
        {"seat": 1.5},
        {"rate": True},
        {"token": 7},
        {"source": "file"},
        {"name": "a\nb"},
        {"name": "Anna\u034f"},
        {"token": "\ud800"},
    ],
)
def test_a_hello_of_the_wrong_kind_is_refused(words: object) -> None:
    with pytest.raises(GatewayError) as caught:
        read_hello(json.dumps(words))
    assert caught.value.code == "malformed"


@pytest.mark.parametrize(
    "words",
    [
        {"type": "protest", "against": 1, "why": "cut \ud800"},
        {"type": "act", "act": "protest", "note": "\udfff", "id": 7},
    ],
)
def test_half_a_character_is_refused_with_a_reason(words: dict[str, object]) -> None:
    with pytest.raises(GatewayError, match="half a character; write text") as caught:
        read_request(json.dumps(words))
    assert caught.value.code == "malformed"
    assert json.loads(refusal_text(caught.value))["code"] == "malformed"


def test_rates_beyond_the_bounds_are_moved_into_them() -> None:
    assert read_hello('{"rate": 1e9}').rate == 60.0
    with pytest.raises(GatewayError):
        read_hello('{"rate": NaN}')


def test_each_token_opens_its_own_role() -> None:
    tokens = Tokens(drive=("a", "b"), steward="c")
    assert tokens.identify(read_hello('{"role": "drive", "token": "b"}')).number == 1
    for words in ('{"role": "drive", "token": "c"}', '{"role": "steward", "token": ""}'):
        with pytest.raises(GatewayError):
            tokens.identify(read_hello(words))
    with pytest.raises(GatewayError):
        Tokens().identify(read_hello('{"role": "steward", "token": ""}'))


def test_spectators_cannot_push_out_the_words_of_drivers() -> None:
    tokens = ResumeTokens(1024)
    driver = tokens.issue(Identity(Role.DRIVE, 0))
    issued = [tokens.issue(Identity(Role.SPECTATE)) for _ in range(1100)]
    assert tokens.find(driver).number == 0
    with pytest.raises(GatewayError):
        tokens.find(issued[0])
    tokens.revoke(driver)
    with pytest.raises(GatewayError):
        tokens.find(driver)


def test_a_name_server_that_lies_does_not_make_a_page_ours() -> None:
    headers = {"origin": "http://evil.example:8080", "host": "evil.example:8080"}
    with pytest.raises(GatewayError, match="evil"):
        check_origin(headers, (), is_local=True)
    check_origin(headers, (), is_local=False)  # there people choose the name
    check_origin({"origin": "http://localhost:1", "host": "localhost:1"}, (), is_local=True)
    check_origin({"host": "localhost:1"}, (), is_local=True)
    for origin in ("null", "http://[", ""):
        with pytest.raises(GatewayError):
            check_origin({"origin": origin, "host": ""}, (), is_local=False)
    assert not is_known_host("[", ())
    assert is_known_host("[::1]:8080", ())
    assert is_known_host("race.example", ("https://race.example",))


def test_each_address_of_this_machine_is_a_name_of_our_own() -> None:
    check_origin({"origin": "http://127.0.0.2:1", "host": "127.0.0.2:1"}, (), is_local=True)
    assert is_known_host("127.0.0.2:1", ())
    assert not is_known_host("127.0.0.2.evil.example:1", ())


def test_beyond_this_machine_a_gateway_wants_a_word_and_tokens() -> None:
    settings = Settings("tcp/127.0.0.1:7447", "race", KeyRing(), host="192.0.2.1")
    with pytest.raises(LinkError, match="say so with --open"):
        check_settings(settings, is_open=False)
    with pytest.raises(KeysError, match="--spectators token"):
        check_settings(settings, is_open=True)
    closed = replace(settings, tokens=Tokens("watch"), certificate=Path("page.pem"))
    with pytest.raises(KeysError, match="come together"):
        check_settings(closed, is_open=True)
    with pytest.raises(KeysError, match="cannot be used"):
        check_settings(replace(closed, private_key=Path("nowhere.pem")), is_open=True)


def test_tokens_stand_behind_the_hash_of_an_address() -> None:
    tokens = Tokens("w", ("d",), "s")
    settings = Settings("tcp/127.0.0.1:7447", "race", KeyRing(), host="::1", tokens=tokens)
    addresses = addresses_of(settings, 8080)
    assert addresses.base == "http://[::1]:8080/"
    assert addresses.watch == "http://[::1]:8080/#watch&token=w"
    assert addresses.drive == ("http://[::1]:8080/#drive&token=d",)


@pytest.mark.parametrize("words", ["8080", "host:", "host:x", ":80", "host:70000"])
def test_a_place_that_is_none_says_how_to_write_one(words: str) -> None:
    with pytest.raises(LinkError, match="write HOST:PORT"):
        place_of(words)
