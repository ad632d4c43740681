"""zenoh's settings of server, client, and of real karts among one another.

They are fixed when a session opens.
"""

import ipaddress
import json
from dataclasses import dataclass
from typing import Any

from race_server.errors import KeysError, LinkError
from race_server.net.auth.access import (
    ANYONE,
    SPECTATOR,
    STEWARD,
    Role,
    access_control,
    common_name,
    peer_access_control,
    roles_of,
)
from race_server.net.auth.keys import CA, CERTIFICATE, KEY, PASSWORDS, ClientKeys, ServerKeys
from race_server.net.auth.limits import (
    peer_rate_limit,
    peer_size_filter,
    rate_limit,
    size_filter,
)

# Timeout of a silent link. A closed link is seen at once; this is for hosts that die, and long
# enough that a network which loses a fifth of all packets breaks no link.
LEASE_MS = 6000
# Small [bytes], because newer messages cannot replace what waits in the kernel.
SEND_BUFFER = 32768
# The loop of a real-time server waits for no network [µs]: where a link is full, newest-wins
# messages are dropped soon, events are queued for seconds, and a link that accepts none is closed.
QUEUE = {
    "size": {"real_time": 4, "interactive_high": 16},
    "congestion_control": {
        "drop": {"wait_before_drop": 200},
        "block": {"wait_before_close": 50_000},
    },
}
# Links of a driver: a second one may replace one that has stalled. Links of the steward.
SEAT_LINKS, STEWARD_LINKS = 2, 4
# Sessions for links beyond those of their key, until they are closed a moment later. Without them
# the holder of one key could keep out the others.
SPARE_SESSIONS = 128
# Limit of spectators without keys.
LOCAL_SPECTATORS = 256
# No valid message of a client is longer [bytes]; longer ones are dropped before reassembly.
MOST_MESSAGE = 65536
# Timeout of zenoh's handshake, which follows that of the encryption, and how many connections may
# be in it.
ACCEPT_MS, MOST_ACCEPTED = 5000, 1000
_ENCRYPTED = ("tls", "quic")
_WITH_PORT = (*_ENCRYPTED, "tcp", "udp", "ws")
_PROTOCOLS = (*_WITH_PORT, "unixsock-stream", "vsock", "serial")
# Seats of a race: those that may be peers of a real kart.
SEATS = range(64)
# How soon and how often a client, and a real kart, try to connect again.
RETRY = {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5}


@dataclass(frozen=True)
class ListenSettings:
    """How a server listens, and to which clients."""

    address: str
    session: str
    seats: int
    keys: ServerKeys | None = None  # None: no credentials, loopback only
    real_time: bool = False  # limits the rate of controls too
    steward_address: str = ""  # a second one, for the steward alone; "": none


def server_settings(settings: ListenSettings) -> dict[str, Any]:
    """Return zenoh's settings of a server's session.

    Raises:
        LinkError: the address is open to other machines and there are no keys.
    """
    check_listen_settings(settings)
    keys, encrypted = settings.keys, is_encrypted(settings.address)
    roles = (ANYONE,) if keys is None else roles_of(settings.seats)
    config: dict[str, Any] = {
        **_common("router", "listen", settings.address, settings.steward_address),
        **({"transport/link/tx/queue": QUEUE} if settings.real_time else {}),
        "listen/exit_on_failure": True,
        "connect/endpoints": [],
        "access_control": access_control(
            settings.session,
            roles,
            passwords=keys is not None,
            certificates=keys is not None and encrypted,
        ),
        "low_pass_filter": size_filter(settings.session),
        "downsampling": rate_limit(settings.session, settings.seats, real_time=settings.real_time),
        "transport/unicast/max_sessions": most_sessions(settings),
        "transport/unicast/accept_timeout": ACCEPT_MS,
        "transport/unicast/accept_pending": MOST_ACCEPTED,
        "transport/link/rx/max_message_size": MOST_MESSAGE,
    }
    if keys is not None:
        config["transport/auth/usrpwd"] = {
            "user": "server",
            "password": keys.token,
            "dictionary_file": str(keys.folder / PASSWORDS),
        }
        if encrypted:
            config["transport/link/tls"] = {
                "root_ca_certificate": str(keys.folder / CA),
                **_certificate_of(keys, "listen"),
                "enable_mtls": True,
                "close_link_on_expiration": True,
            }
    return config


def client_settings(address: str, keys: ClientKeys | None, timeout_s: float) -> dict[str, Any]:
    """Return zenoh's settings of a client's session.

    Raises:
        KeysError: the address is encrypted and there is no certificate.
    """
    settings: dict[str, Any] = {
        **_common("client", "connect", address, timeout_ms=round(timeout_s * 1000)),
        "connect/exit_on_failure": True,
        "connect/retry": RETRY,
        "listen/endpoints": [],
    }
    if keys is not None:
        settings["transport/auth/usrpwd"] = {"user": keys.user, "password": keys.password}
    if is_encrypted(address):
        if keys is None or not (keys.folder / CERTIFICATE).exists():
            raise KeysError(
                f"{address} is encrypted and requires a certificate: pass the folder from the "
                "organiser with --keys"
            )
        settings["transport/link/tls"] = {
            "root_ca_certificate": str(keys.folder / CA),
            **_certificate_of(keys, "connect"),
            "enable_mtls": True,
            "verify_name_on_connect": True,
        }
    return settings


@dataclass(frozen=True)
class PeerSettings:
    """Where a real kart and its peers listen to one another, and who it is."""

    address: str  # its own
    others: tuple[str, ...]
    session: str
    seat: int
    keys: ClientKeys | None = None  # None: no credentials, loopback only


def peer_settings(settings: PeerSettings) -> dict[str, Any]:
    """Return zenoh's settings of a real kart's session with the others.

    Raises:
        LinkError: an address can be reached from other machines and is not encrypted.
        KeysError: it is encrypted and there is no certificate.
    """
    keys, addresses = settings.keys, (settings.address, *settings.others)
    is_secret = all(map(is_encrypted, addresses))
    if not is_secret and not all(map(is_local, addresses)):
        raise LinkError(
            f"{', '.join(addresses)}: real karts on a network know each other by their "
            "certificates; pass addresses such as tls/192.168.1.21:7460, and --keys"
        )
    if is_secret and (keys is None or not (keys.folder / CERTIFICATE).exists()):
        raise KeysError(
            f"{settings.address} is encrypted and requires a certificate: pass the folder from "
            "the organiser with --keys"
        )
    control = peer_access_control(settings.session, settings.seat, SEATS, keys=is_secret)
    config: dict[str, Any] = {
        **_common("peer", "listen", settings.address),
        "listen/exit_on_failure": True,
        "connect/endpoints": list(settings.others),
        # Karts come and go: each is tried again for as long as this one runs.
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": RETRY,
        "transport/link/tx/queue": QUEUE,
        "access_control": control,
        "low_pass_filter": peer_size_filter(settings.session),
        "downsampling": peer_rate_limit(settings.session, SEATS),
        "transport/unicast/max_sessions": 2 * len(SEATS),
        "transport/unicast/accept_timeout": ACCEPT_MS,
        "transport/link/rx/max_message_size": MOST_MESSAGE,
    }
    if is_secret:
        assert keys is not None
        config["transport/link/tls"] = {
            "root_ca_certificate": str(keys.folder / CA),
            **_certificate_of(keys, "listen"),
            **_certificate_of(keys, "connect"),
            "enable_mtls": True,
            # A kart's certificate names its seat, not its address.
            "verify_name_on_connect": False,
            "close_link_on_expiration": True,
        }
    return config


def _certificate_of(keys: ClientKeys | ServerKeys, where: str) -> dict[str, str]:
    return {
        f"{where}_certificate": str(keys.folder / CERTIFICATE),
        f"{where}_private_key": str(keys.folder / KEY),
    }


def _common(mode: str, where: str, *addresses: str, timeout_ms: int = 0) -> dict[str, Any]:
    return {
        "mode": mode,
        f"{where}/endpoints": [address for address in addresses if address],
        f"{where}/timeout_ms": timeout_ms,
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,  # no peers are searched for; half a second by default
        "scouting/gossip/enabled": False,
        "adminspace/enabled": False,
        # Shared memory bypasses the limit on message sizes.
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tcp/so_sndbuf": SEND_BUFFER,
    }


def places_of(settings: ListenSettings) -> dict[str, int]:
    """Return how many links each common name may have at once."""
    spectators = settings.keys.spectators if settings.keys else LOCAL_SPECTATORS

    def places(role: Role) -> int:
        return {SPECTATOR: spectators, STEWARD: STEWARD_LINKS}.get(role.name, SEAT_LINKS)

    roles = roles_of(settings.seats)
    return {common_name(settings.session, role.name): places(role) for role in roles}


def most_sessions(settings: ListenSettings) -> int:
    """Return the limit of all connected clients."""
    return sum(places_of(settings).values()) + SPARE_SESSIONS


def check_listen_settings(settings: ListenSettings) -> None:
    """Check that a server accepts only authorised clients.

    Raises:
        LinkError: an address is none; it would be open to other machines without keys, or lacks
            certificates.
    """
    for address in filter(None, (settings.address, settings.steward_address)):
        check_address(address)
    if settings.keys is None and not is_local(settings.address):
        raise LinkError(
            f"{settings.address} can be reached from other machines, and without keys any of them "
            f"could race: make keys with `race keys new {settings.session}` and serve with "
            "--open --keys FOLDER, or listen on this machine only, such as tcp/127.0.0.1:7447"
        )
    if steward := settings.steward_address:
        if not (is_encrypted(settings.address) and is_encrypted(steward)):
            raise LinkError(
                f"{steward} is for the steward alone, which the server knows by its certificate: "
                "pass tls/ADDRESS:PORT to both --listen and --steward-listen"
            )
        if port_of(steward) == port_of(settings.address):
            raise LinkError(
                f"{steward} has the port of {settings.address}: the steward needs another one"
            )
    if settings.keys is None and is_encrypted(settings.address):
        raise LinkError(
            f"{settings.address} is encrypted and needs certificates: make keys with "
            f"`race keys new {settings.session}` and serve with --open --keys FOLDER"
        )


def check_address(address: str) -> None:
    """Check the form of an address.

    Raises:
        LinkError: it does not begin with a protocol, or has no port.
    """
    protocol, slash, _ = address.partition("/")
    if not slash or protocol not in _PROTOCOLS:
        at = address if address.rpartition(":")[2].isdecimal() else f"{address}:7447"
        raise LinkError(f"{address!r} is no address: write tcp/{at}, or tls/{at} with keys")
    if protocol in _WITH_PORT:
        port_of(address)


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
    """Return the host of ``host:port?options``."""
    return place.split("#")[0].split("?")[0].rpartition(":")[0].strip("[]")


def port_of(address: str) -> int:
    """Return the port of an address.

    Raises:
        LinkError: it has none.
    """
    port = address.split("#")[0].split("?")[0].rpartition(":")[2]
    if not port.isdecimal():
        raise LinkError(f"{address} has no port: pass one such as tls/0.0.0.0:7447")
    return int(port)


def as_json(settings: dict[str, Any]) -> list[tuple[str, str]]:
    """Return settings in the form that zenoh takes."""
    return [(key, json.dumps(value)) for key, value in settings.items()]
