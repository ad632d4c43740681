"""Make the keys of a session: its own authority, certificates and passwords.

Needs the package `cryptography`; nothing else in this project does. The key of the authority is
not stored, so that no further certificates can be signed.
"""

import ipaddress
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from race_server.errors import KeysError
from race_server.net.auth.access import SPECTATOR, STEWARD, common_name, seat_name
from race_server.net.auth.keys import (
    CA,
    CERTIFICATE,
    KEY,
    PASSWORDS,
    ClientKeys,
    ServerKeys,
    write_keys,
    write_private,
)
from race_server.net.wire import topics

try:
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
except ImportError as error:  # pragma: no cover - the extra is installed where this is tested
    raise KeysError(
        "making keys needs the package `cryptography`: `pip install race-server[keys]` brings it"
    ) from error

LOCAL_HOSTS = ("127.0.0.1", "::1", "localhost")
# A part of a host's name between dots; the last one is no number, else it would be an address.
_LABEL, _LAST = re.compile(r"(?!-)[a-z0-9_-]{1,63}(?<!-)", re.IGNORECASE), re.compile(r".*[^\d].*")
MOST_HOST = 253
# Certificates are valid from this long before now, since clocks of karts are not exact.
BEFORE = timedelta(hours=1)


@dataclass(frozen=True)
class Order:
    """The keys to make."""

    session: str
    seats: int = 8
    spectators: int = 8  # at once; all use the same keys
    hosts: tuple[str, ...] = ()  # names and addresses of the server, the first one for clients
    port: int = 7447
    days: float = 7.0


class Authority:
    """Signs certificates for one session."""

    def __init__(self, session: str, days: float) -> None:
        """Draw a key and make its self-signed certificate."""
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._name = _name(f"{session} authority")
        self._begin = datetime.now(UTC) - BEFORE
        self.end = datetime.now(UTC).replace(microsecond=0) + timedelta(days=days)
        builder = self._builder(self._name, self._key.public_key())
        builder = builder.add_extension(
            x509.BasicConstraints(ca=True, path_length=0), critical=True
        )
        self.certificate = builder.sign(self._key, hashes.SHA256())

    def _builder(
        self, subject: x509.Name, key: ec.EllipticCurvePublicKey
    ) -> x509.CertificateBuilder:
        return (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self._name)
            .public_key(key)
            .serial_number(x509.random_serial_number())
            .not_valid_before(self._begin)
            .not_valid_after(self.end)
        )

    def certify(
        self, folder: Path, name: str, hosts: Sequence[str] = (), *, is_peer: bool = False
    ) -> None:
        """Write authority, certificate and key into a folder; with `hosts` for a server.

        is_peer: of a real kart, to which others connect, too. Its certificate names no host, so no
        client takes it for a server.
        """
        key = ec.generate_private_key(ec.SECP256R1())
        uses = [ExtendedKeyUsageOID.SERVER_AUTH if hosts else ExtendedKeyUsageOID.CLIENT_AUTH]
        uses += [ExtendedKeyUsageOID.SERVER_AUTH] if is_peer else []
        names = [_host(host) for host in hosts] or [x509.DNSName(name)]
        certificate = (
            self._builder(_name(name), key.public_key())
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(x509.ExtendedKeyUsage(uses), critical=False)
            .add_extension(x509.SubjectAlternativeName(names), critical=False)
            .sign(self._key, hashes.SHA256())
        )
        pem = serialization.Encoding.PEM
        write_private(folder / CA, self.certificate.public_bytes(pem))
        write_private(folder / CERTIFICATE, certificate.public_bytes(pem))
        private = key.private_bytes(
            pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
        write_private(folder / KEY, private)


def issue_keys(order: Order, folder: Path) -> list[ClientKeys]:
    """Write the keys of a session into a new folder and return those to hand out.

    Raises:
        KeysError: the folder is not empty, or cannot be written; a host is none.
        WireError: the session's name is not valid.
    """
    topics.key_of(topics.SNAPSHOT, order.session)
    order = replace(order, hosts=tuple(map(_checked_host, order.hosts)))
    try:
        _make(folder)
        return _issue(order, folder)
    except OSError as error:
        raise KeysError(f"{folder}: cannot be written ({error.strerror})") from error


def _make(folder: Path) -> None:
    if folder.exists() and any(folder.iterdir()):
        raise KeysError(
            f"{folder} is not empty: keys are made once; pass another --folder, or remove it "
            "if its keys are no longer used"
        )
    folder.mkdir(parents=True, exist_ok=True)
    folder.chmod(0o700)


def _issue(order: Order, folder: Path) -> list[ClientKeys]:
    authority = Authority(order.session, order.days)
    expires, token = authority.end.isoformat(), secrets.token_hex(16)
    hosts = (*order.hosts, *(host for host in LOCAL_HOSTS if host not in order.hosts))
    home = f"[{hosts[0]}]" if ":" in hosts[0] else hosts[0]
    handed = []
    names = [seat_name(seat) for seat in range(order.seats)]
    for seat, role in enumerate([*names, SPECTATOR, STEWARD]):
        own = folder / role
        own.mkdir(mode=0o700)
        name = common_name(order.session, role)
        authority.certify(own, name, is_peer=seat < order.seats)
        keys = ClientKeys(
            folder=own,
            session=order.session,
            role=role,
            user=name,
            password=secrets.token_urlsafe(18),
            address=f"tls/{home}:{order.port}",
            expires=expires,
            seat=seat if seat < order.seats else -1,
            token=token if role == STEWARD else "",
        )
        write_keys(keys)
        handed.append(keys)
    server = folder / "server"
    server.mkdir(mode=0o700)
    authority.certify(server, common_name(order.session, "server"), hosts)
    lines = "".join(f"{keys.user}:{keys.password}\n" for keys in handed)
    write_private(server / PASSWORDS, lines)
    write_keys(ServerKeys(server, order.session, order.seats, order.spectators, expires, token))
    write_private(folder / "README.md", _readme(order, handed[0].address, authority.end))
    return handed


def _readme(order: Order, address: str, end: datetime) -> str:
    serve = f"race serve --open --keys . --session {order.session} --karts {order.seats}"
    return f"""# Keys of the race session {order.session}

They expire on {end:%Y-%m-%d %H:%M} UTC. Hand each folder to one person in a way that others
cannot read: a USB stick, or an encrypted message. The server takes the holder of a folder for that
person.

| folder | for | used with |
| --- | --- | --- |
| `server` | no one: it stays on the server | `{serve}` |
| `seat-0` to `seat-{order.seats - 1}` | the driver of that seat | `race drive NAME --keys seat-0` |
| `spectator` | spectators, {order.spectators} at once | `race watch --keys spectator` |
| `steward` | the steward | `race admin flag yellow --keys steward` |

Drivers connect to `{address}` unless `--connect` is given.

A folder that was lost or copied is revoked with `race keys revoke . seat-3` on the server's
machine, while the server runs or before. Make new keys for the next race and delete these.
"""


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])


def _checked_host(host: str) -> str:
    """Return a host as it stands in certificates and addresses: letters of IDNA, no port.

    Raises:
        KeysError: it is no name and no address of a host.
    """
    way_out = "give a name or an address, such as race.example.org or 192.168.1.10"
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        pass
    name, colon, port = host.rpartition(":")
    if colon and port.isdecimal():
        raise KeysError(f"--host {host!r}: leave the port out, and give it with --port: {name}")
    try:
        written = host.encode("idna").decode("ascii")
    except UnicodeError as error:
        raise KeysError(f"--host {host!r}: is no name of a host ({error}); {way_out}") from error
    labels = written.split(".")
    fits = all(map(_LABEL.fullmatch, labels)) and _LAST.fullmatch(labels[-1])
    if not fits or len(written) > MOST_HOST:
        raise KeysError(f"--host {host!r}: is no name of a host; {way_out}")
    return written


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)
