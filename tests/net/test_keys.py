"""Keys in folders, and the steward's token."""

import io
import json
import stat
from contextlib import ExitStack
from pathlib import Path

import pytest

from race_server.cli.service import steward_token
from race_server.errors import KeysError, SeatError
from race_server.live.server.steward import Steward
from race_server.logs import Log
from race_server.net.auth.issue import Order, issue_keys
from race_server.net.auth.keys import read_client_keys, read_server_keys
from race_server.net.auth.settings import (
    SPARE_SESSIONS,
    ListenSettings,
    server_settings,
)
from race_server.net.auth.token import local_token, read_token
from race_server.net.wire.admin import (
    Decision,
)
from support.sessions import session_on_ring


def test_keys_are_for_their_owner_only_and_the_authority_is_thrown_away(keys: Path) -> None:
    for path in (keys, *keys.rglob("*")):
        assert stat.S_IMODE(path.stat().st_mode) == (0o700 if path.is_dir() else 0o600), path
    certificates = {path.parent.name for path in keys.rglob("key.pem")}
    assert certificates == {"server", "seat-0", "seat-1", "spectator", "steward"}


def test_certificates_name_the_role_and_the_server_its_hosts(keys: Path) -> None:
    x509 = pytest.importorskip("cryptography.x509")
    own = x509.load_pem_x509_certificate((keys / "seat-1" / "certificate.pem").read_bytes())
    assert own.subject.rfc4514_string() == "CN=cup-seat-1"
    server = x509.load_pem_x509_certificate((keys / "server" / "certificate.pem").read_bytes())
    names = server.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    hosts = {str(name.value) for name in names}
    assert hosts == {"10.0.0.7", "127.0.0.1", "::1", "localhost"}


def test_only_the_steward_is_handed_the_token(keys: Path) -> None:
    server = read_server_keys(keys, "cup", 2)
    assert read_client_keys(keys / "steward").token == server.token
    assert not read_client_keys(keys / "seat-0").token
    assert read_client_keys(keys / "seat-0").address == "tls/10.0.0.7:7447"


def test_a_folder_without_keys_is_refused_with_those_that_have_some(keys: Path) -> None:
    roles = "seat-0, seat-1, server, spectator, steward"
    with pytest.raises(KeysError, match=f"pass one in it: {roles}"):
        read_client_keys(keys)
    with pytest.raises(KeysError, match=f"pass one beside it: {roles}"):
        read_client_keys(keys / "seat-3")
    with pytest.raises(KeysError, match="pass a folder of `race keys new`"):
        read_client_keys(keys / "seat-3" / "none")


def test_keys_of_another_session_or_too_few_seats_are_refused(keys: Path) -> None:
    with pytest.raises(KeysError, match="are for session 'cup', not 'final'"):
        read_client_keys(keys / "seat-0", "final")
    with pytest.raises(KeysError, match="are for 2 seats, the race has 8"):
        read_server_keys(keys, "cup", 8)
    with pytest.raises(KeysError, match="is not empty"):
        issue_keys(Order("cup"), keys)


@pytest.mark.parametrize(
    ("host", "said"),
    [
        ("192.168.1.10:7447", "leave the port out, and give it with --port: 192.168.1.10"),
        ("race.example.org:7447", "leave the port out, and give it with --port: race.example.org"),
        ("", "give a name or an address, such as"),
        ("tcp/10.0.0.1", "give a name or an address, such as"),
        ("192.168.1", "give a name or an address, such as"),
        ("300.1.1.1", "give a name or an address, such as"),
        ("a b", "give a name or an address, such as"),
        ("-a.org", "give a name or an address, such as"),
        ("a..org", "give a name or an address, such as"),
        (64 * "a", "give a name or an address, such as"),
        (5 * f"{60 * 'a'}.", "give a name or an address, such as"),
        ("[::1]", "give a name or an address, such as"),
    ],
)
def test_what_is_no_host_is_refused_before_a_folder_is_made(
    host: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(KeysError) as told:
        issue_keys(Order("cup", 1, hosts=("localhost", host)), tmp_path / "cup")
    assert str(told.value).startswith(f"--host {host!r}: ")
    assert said in str(told.value)
    assert not (tmp_path / "cup").exists()


@pytest.mark.parametrize(
    ("host", "address"),
    [
        ("münchen.de", "tls/xn--mnchen-3ya.de:7447"),
        ("Race-1.local", "tls/Race-1.local:7447"),
        ("10.0.0.1", "tls/10.0.0.1:7447"),
        ("fe80::0001", "tls/[fe80::1]:7447"),
    ],
)
def test_a_host_is_written_as_networks_write_it(host: str, address: str, tmp_path: Path) -> None:
    handed = issue_keys(Order("cup", 1, hosts=(host,)), tmp_path / "cup")
    assert {keys.address for keys in handed} == {address}


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[]", "the file = []: give a table"),
        ("{}", "session is missing"),
        ('{"session": 5}', "session = 5: give a text"),
        ('{"seats": 8}', "seats is unknown"),
        ("nothing", "Expecting value"),
        ("[" * 100_000, "recursion"),
    ],
)
def test_of_a_damaged_file_of_keys_its_fault_is_said(text: str, fault: str, tmp_path: Path) -> None:
    (tmp_path / "keys.json").write_text(text)
    with pytest.raises(KeysError) as told:
        read_client_keys(tmp_path)
    assert fault in str(told.value)
    assert "__init__" not in str(told.value)
    assert str(told.value).endswith("or make new keys with `race keys new`")


def test_keys_that_expired_or_do_not_belong_together_are_refused(tmp_path: Path) -> None:
    issue_keys(Order("cup", 2), tmp_path / "cup")
    own, other = tmp_path / "cup" / "seat-0", tmp_path / "cup" / "seat-1"
    (own / "key.pem").write_bytes((other / "key.pem").read_bytes())
    with pytest.raises(KeysError, match="do not belong together"):
        read_client_keys(own)
    about = json.loads((other / "keys.json").read_text()) | {"expires": "2001-01-01T00:00:00+00:00"}
    (other / "keys.json").write_text(json.dumps(about))
    with pytest.raises(KeysError, match="expired on 2001-01-01"):
        read_client_keys(other)
    (other / "keys.json").write_text(json.dumps(about | {"expires": "2001-01-01T00:00:00"}))
    with pytest.raises(KeysError, match="expired on 2001-01-01 00:00 UTC"):
        read_client_keys(other)
    (other / "keys.json").write_text("[]")
    with pytest.raises(KeysError, match="damaged"):
        read_client_keys(other)


def test_settings_without_keys_ask_for_no_credentials(keys: Path) -> None:
    closed = server_settings(ListenSettings("tcp/127.0.0.1:7447", "cup", 2))
    assert "transport/auth/usrpwd" not in closed
    assert closed["transport/shared_memory/enabled"] is False
    held = read_server_keys(keys, "cup", 2)
    opened = server_settings(ListenSettings("tls/0.0.0.0:7447", "cup", 2, held))
    assert opened["transport/link/tls"]["enable_mtls"] is True
    assert opened["transport/unicast/max_sessions"] == 2 * 2 + 1 + 4 + SPARE_SESSIONS


def test_the_token_of_a_closed_session_lies_there_while_it_is_served(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with local_token("tcp/127.0.0.1:7447", "cup") as token:
        assert read_token("tcp/127.0.0.1:7447", "cup") == token
        path = next(tmp_path.rglob("*.token"))
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with pytest.raises(KeysError, match="no token of a steward"):
        read_token("tcp/127.0.0.1:7447", "cup")


def test_a_server_whose_token_cannot_be_written_races_without_a_steward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "file" / "folder"))
    said = io.StringIO()
    with Log(stream=said) as log, ExitStack() as stack:
        token = steward_token("tcp/127.0.0.1:7447", "cup", log, stack)
    assert token == ""
    assert said.getvalue().count("races have no steward") == 1
    with pytest.raises(SeatError, match="the token does not fit"):
        Steward(session_on_ring("cup"), token).check(Decision(token, "log"))
