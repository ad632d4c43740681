"""Who may send what on the network: access rules, rates, sizes, badges."""

import pytest

from race_server.credentials import badge_of, key_of, key_of_badge
from race_server.errors import LinkError
from race_server.net.auth.access import (
    ANYONE,
    access_control,
    keys_allowed,
    peer_access_control,
    roles_of,
)
from race_server.net.auth.limits import peer_rate_limit, rate_limit, size_filter
from race_server.net.auth.seat_owners import SeatOwners
from race_server.net.auth.settings import (
    ListenSettings,
    PeerSettings,
    check_listen_settings,
    is_local,
    peer_settings,
)
from race_server.net.transport import ClientLink
from race_server.net.wire import topics

SEAT, OTHER, SPECTATOR, STEWARD = roles_of(2)


# Rules made of the table of topics


def test_a_seat_sends_and_lives_on_its_own_keys_only() -> None:
    allowed = keys_allowed("cup", SEAT)
    told = ["in/0", "pose/0", "alert/0", "telemetry/0"]
    assert allowed["send"] == [f"race/cup/{key}" for key in told]
    assert allowed["live"] == ["race/cup/alive/0/*"]
    assert "race/cup/obs/0" in allowed["listen"]
    assert "race/cup/q/join/0" in allowed["ask"]
    assert not [key for keys in allowed.values() for key in keys if "/1" in key or "any" in key]


def test_a_spectator_sends_nothing_and_asks_for_no_seat() -> None:
    allowed = keys_allowed("cup", SPECTATOR)
    assert set(allowed) == {"listen", "hear", "ask", "be answered"}
    assert all(key.startswith("race/cup/out/") for key in allowed["listen"])
    assert not [key for key in allowed["ask"] if "join" in key or "admin" in key]


def test_a_coach_has_the_keys_of_a_steward_and_a_driver_hears_only_its_own_words() -> None:
    coaches = {role.name: keys_allowed("cup", role) for role in roles_of(2)}
    sends = {name: kinds.get("send", []) for name, kinds in coaches.items()}
    assert [name for name, keys in sends.items() if "race/cup/coach/*" in keys] == ["steward"]
    assert not [key for name in sends if name != "steward" for key in sends[name] if "coach" in key]
    hears = {
        name: [key for key in kinds["hear"] if "coach" in key] for name, kinds in coaches.items()
    }
    assert hears == {
        "seat-0": ["race/cup/coach/0"],
        "seat-1": ["race/cup/coach/1"],
        "spectator": [],
        "steward": [],
    }


def test_only_the_steward_may_ask_for_what_is_the_stewards() -> None:
    asks = {role.name: keys_allowed("cup", role)["ask"] for role in roles_of(2)}
    assert [name for name, keys in asks.items() if "race/cup/admin/act" in keys] == ["steward"]


def test_every_topic_that_clients_use_is_in_the_rules_of_a_closed_session() -> None:
    allowed = {key for keys in keys_allowed("cup", ANYONE).values() for key in keys}
    for topic in topics.TOPICS:
        if topic.direction == "peer":  # no server has to do with it
            continue
        place = topics.EVERY if topic.is_seats else -1
        assert topics.key_of(topic, "cup", place) in allowed


def test_a_server_passes_nothing_on_between_real_karts() -> None:
    allowed = {key for keys in keys_allowed("cup", ANYONE).values() for key in keys}
    assert not [key for key in allowed if "/peer/" in key]


def test_a_real_kart_believes_each_certificate_for_its_own_seat_only() -> None:
    control = peer_access_control("cup", 1, range(3), keys=True)
    assert control["default_permission"] == "deny"
    names = [subject["cert_common_names"] for subject in control["subjects"]]
    assert names == [["cup-seat-0"], ["cup-seat-2"]]
    sends = {
        rule["id"]: rule["key_exprs"] for rule in control["rules"] if rule["id"].endswith("send")
    }
    assert sends == {"seat-0 may send": ["race/cup/peer/0"], "seat-2 may send": ["race/cup/peer/2"]}


def test_each_real_kart_has_a_rate_of_its_own() -> None:
    (rates,) = peer_rate_limit("cup", range(2))
    assert rates["rules"] == [
        {"key_expr": "race/cup/peer/0", "freq": 100.0},
        {"key_expr": "race/cup/peer/1", "freq": 100.0},
    ]


@pytest.mark.parametrize(
    "addresses",
    [
        ("tcp/192.168.1.21:7460", "tcp/127.0.0.1:7461"),
        ("tcp/127.0.0.1:7460", "tcp/192.168.1.22:7460"),
        ("tls/192.168.1.21:7460", "tcp/192.168.1.22:7460"),
    ],
)
def test_real_karts_on_a_network_need_certificates(addresses: tuple[str, str]) -> None:
    with pytest.raises(LinkError, match="know each other by their certificates"):
        peer_settings(PeerSettings(addresses[0], addresses[1:], "cup", 0))


def test_what_no_rule_allows_is_denied_and_both_credentials_must_fit() -> None:
    control = access_control("cup", roles_of(2), passwords=True, certificates=True)
    assert control["default_permission"] == "deny"
    assert {rule["permission"] for rule in control["rules"]} == {"allow"}
    assert control["subjects"][1] == {
        "id": "seat-1",
        "usernames": ["cup-seat-1"],
        "cert_common_names": ["cup-seat-1"],
    }


def test_each_key_has_a_rate_of_its_own_and_lockstep_has_none_for_controls() -> None:
    rates = {row["id"]: row["rules"] for row in rate_limit("cup", 2, real_time=True)}
    keys = [rule["key_expr"] for rule in rates["rate of in/{seat}"]]
    assert {"race/cup/in/0", "race/cup/in/1"} <= set(keys)
    assert not [key for key in keys if "*" in key]
    in_lockstep = {row["id"] for row in rate_limit("cup", 2, real_time=False)}
    # There a client asks for the events of each decision, however fast the world is.
    assert rates.keys() - in_lockstep == {
        "rate of in/{seat}",
        "rate of pose/{seat}",
        "rate of alert/{seat}",
        "rate of telemetry/{seat}",
        "rate of coach/{seat}",
        "rate of q/events",
    }


def test_whatever_a_client_sends_has_a_size() -> None:
    covered = {row["key_exprs"][0] for row in size_filter("cup")}
    assert {"race/cup/in/*", "race/cup/q/join/*", "race/cup/admin/act"} <= covered


@pytest.mark.parametrize(
    ("address", "local"),
    [
        ("tcp/127.0.0.1:7447", True),
        ("tcp/[::1]:7447", True),
        ("tcp/localhost:7447", True),
        ("tcp/0.0.0.0:7447", False),
        ("tcp/[::]:7447", False),
        ("tcp/192.168.1.5:7447", False),
        ("tcp/127.0.0.1.example.org:7447", False),
        ("unixsock-stream/tmp/race", True),
    ],
)
def test_an_address_that_others_can_reach_needs_keys(address: str, *, local: bool) -> None:
    assert is_local(address) is local
    if not local:
        with pytest.raises(LinkError, match="without keys any of them could race"):
            check_listen_settings(ListenSettings(address, "race", 2))


@pytest.mark.parametrize(
    ("address", "right"),
    [
        ("127.0.0.1:7447", "write tcp/127.0.0.1:7447,"),
        ("192.168.1.10", "write tcp/192.168.1.10:7447,"),
        ("http/localhost:80", "'http/localhost:80' is no address"),
        ("tcp/localhost", "tcp/localhost has no port"),
    ],
)
def test_an_address_that_is_none_is_refused_with_what_to_write(address: str, right: str) -> None:
    with pytest.raises(LinkError, match=right):
        check_listen_settings(ListenSettings(address, "race", 2))
    with pytest.raises(LinkError, match=right):
        ClientLink(address, "race")


# Badges


def test_the_key_tells_neither_badge_nor_secret() -> None:
    assert key_of(7) == key_of_badge(badge_of(7).encode())
    assert key_of(7).hex() != badge_of(7)


def test_only_the_badge_that_fits_holds_a_seat_whichever_comes_first() -> None:
    own, thief = badge_of(7).encode(), badge_of(8).encode()
    holders = SeatOwners(2)
    assert holders.note_link(1, own, is_there=True)
    assert not holders.news
    holders.admit(1, key_of(7))
    assert list(holders.news) == [(1, True)]
    assert holders.is_holder(1, own)
    assert not holders.is_holder(1, thief)
    assert not holders.note_link(1, thief, is_there=True)
    assert holders.note_link(1, thief, is_there=False)
