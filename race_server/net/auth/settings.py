"""zenoh's settings of both ends. They are frozen when a session opens: nothing is added later."""

import ipaddress
import json
from dataclasses import dataclass
from typing import Any

from race_server.errors import KeysError, LinkError
from race_server.net.auth.access import ANYONE, access_control, roles_of
from race_server.net.auth.keys import CA, CERTIFICATE, KEY, PASSWORDS, ClientKeys, ServerKeys
from race_server.net.auth.limits import rate_limit, size_filter

# A link that is silent for so long is given up. Who leaves is seen at once; this is for hosts that
# die, and long enough that a network which loses a fifth of all packets breaks no link.
LEASE_MS = 6000
# What waits in the kernel can no longer be overtaken by something newer, so little may [bytes].
SEND_BUFFER = 32768
# The loop of a real-time server waits for nobody's network: newest-wins messages soon fall out
# where a link is full, events have room for seconds, and a link that takes none is given up [µs].
QUEUE = {
    "size": {"real_time": 4, "interactive_high": 16},
    "congestion_control": {
        "drop": {"wait_before_drop": 200},
        "block": {"wait_before_close": 50_000},
    },
}
# Beyond seats and spectators: a steward, and links that are about to end.
SPARE_SESSIONS = 4
# Without keys so many may watch.
LOCAL_SPECTATORS = 256
# Nothing that a client sends is longer; what is, is dropped before it is put together.
MOST_MESSAGE = 65536
# Who connects and then says nothing is let go after so long; a hundred may wait.
ACCEPT_MS = 5000
_ENCRYPTED = ("tls", "quic")


@dataclass(frozen=True)
class ListenSettings:
    """How a server lets clients in."""

    address: str
    session: str
    seats: int
    keys: ServerKeys | None = None  # None: no credentials, on loopback only
    real_time: bool = False  # controls are limited in number too


def server_settings(door: ListenSettings) -> dict[str, Any]:
    """Return the settings of a server's session.

    Raises:
        LinkError: the address is open to other machines and there are no keys.
    """
    check_listen_settings(door)
    keys, encrypted = door.keys, is_encrypted(door.address)
    roles = (ANYONE,) if keys is None else roles_of(door.seats)
    settings: dict[str, Any] = {
        **_common("router", "listen", door.address),
        **({"transport/link/tx/queue": QUEUE} if door.real_time else {}),
        "listen/exit_on_failure": True,
        "connect/endpoints": [],
        "access_control": access_control(
            door.session,
            roles,
            passwords=keys is not None,
            certificates=keys is not None and encrypted,
        ),
        "low_pass_filter": size_filter(door.session),
        "downsampling": rate_limit(door.session, door.seats, real_time=door.real_time),
        "transport/unicast/max_sessions": most_sessions(door),
        "transport/unicast/accept_timeout": ACCEPT_MS,
        "transport/link/rx/max_message_size": MOST_MESSAGE,
    }
    if keys is not None:
        settings["transport/auth/usrpwd"] = {
            "user": "server",
            "password": keys.token,
            "dictionary_file": str(keys.folder / PASSWORDS),
        }
        if encrypted:
            settings["transport/link/tls"] = {
                "root_ca_certificate": str(keys.folder / CA),
                "listen_certificate": str(keys.folder / CERTIFICATE),
                "listen_private_key": str(keys.folder / KEY),
                "enable_mtls": True,
                "close_link_on_expiration": True,
            }
    return settings


def client_settings(address: str, keys: ClientKeys | None, timeout_s: float) -> dict[str, Any]:
    """Return the settings of a client's session.

    Raises:
        KeysError: the address is encrypted and there is no certificate.
    """
    settings: dict[str, Any] = {
        **_common("client", "connect", address, timeout_ms=round(timeout_s * 1000)),
        "connect/exit_on_failure": True,
        "connect/retry": {
            "period_init_ms": 100,
            "period_max_ms": 200,
            "period_increase_factor": 1.5,
        },
        "listen/endpoints": [],
    }
    if keys is not None:
        settings["transport/auth/usrpwd"] = {"user": keys.user, "password": keys.password}
    if is_encrypted(address):
        if keys is None or not (keys.folder / CERTIFICATE).exists():
            raise KeysError(
                f"{address} is encrypted and asks for a certificate: give the folder that the "
                "organiser handed you with --keys"
            )
        settings["transport/link/tls"] = {
            "root_ca_certificate": str(keys.folder / CA),
            "connect_certificate": str(keys.folder / CERTIFICATE),
            "connect_private_key": str(keys.folder / KEY),
            "enable_mtls": True,
            "verify_name_on_connect": True,
        }
    return settings


def _common(mode: str, where: str, address: str, *, timeout_ms: int = 0) -> dict[str, Any]:
    return {
        "mode": mode,
        f"{where}/endpoints": [address],
        f"{where}/timeout_ms": timeout_ms,
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,  # nobody is looked for; half a second by default
        "scouting/gossip/enabled": False,
        "adminspace/enabled": False,
        # Shared memory goes past the limit on messages' sizes.
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tcp/so_sndbuf": SEND_BUFFER,
    }


def most_sessions(door: ListenSettings) -> int:
    """Return how many clients may be connected at once: drivers twice, while a link stalls."""
    spectators = door.keys.spectators if door.keys else LOCAL_SPECTATORS
    return 2 * door.seats + spectators + SPARE_SESSIONS


def check_listen_settings(door: ListenSettings) -> None:
    """Do nothing for a server that only lets in whom it should.

    Raises:
        LinkError: it would be open to other machines without keys, or its keys are of no use.
    """
    if door.keys is None and not is_local(door.address):
        raise LinkError(
            f"{door.address} can be reached from other machines, and without keys anybody there "
            f"could race: make keys with `race keys new {door.session}` and serve with "
            "--open --keys FOLDER, or listen on this machine only, such as tcp/127.0.0.1:7447"
        )
    if door.keys is None and is_encrypted(door.address):
        raise LinkError(
            f"{door.address} is encrypted and needs certificates: make keys with "
            f"`race keys new {door.session}` and serve with --open --keys FOLDER"
        )


def is_encrypted(address: str) -> bool:
    """Return whether a link to an address is encrypted."""
    return address.split("/", 1)[0] in _ENCRYPTED


def is_local(address: str) -> bool:
    """Return whether an address can be reached from this machine only."""
    protocol, _, place = address.partition("/")
    if protocol == "unixsock-stream":
        return True
    host = host_of(place)
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False  # a name, which may stand for any address


def host_of(place: str) -> str:
    """Return the host of ``host:port``, whatever follows."""
    return place.split("#")[0].split("?")[0].rpartition(":")[0].strip("[]")


def as_json(settings: dict[str, Any]) -> list[tuple[str, str]]:
    """Return settings as zenoh takes them."""
    return [(key, json.dumps(value)) for key, value in settings.items()]
