"""What a gateway serves, for which browsers, and at which address."""

import socket
import ssl
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from race_server.errors import KeysError, LinkError
from race_server.live.gateway.key_ring import KeyRing
from race_server.live.gateway.limits import GatewayLimits, GatewayTiming
from race_server.live.gateway.origins import is_loopback
from race_server.live.gateway.roles import Tokens, new_token

DEFAULT_PLACE = "127.0.0.1:8080"
_EVERYWHERE = ("0.0.0.0", "::")


@dataclass(frozen=True)
class Settings:
    """Everything that is fixed when a gateway starts."""

    address: str  # of the race
    session: str
    ring: KeyRing
    kart: str = ""  # address of a kart's program on this machine, "" for none
    host: str = "127.0.0.1"
    port: int = 8080  # 0 for any that is free
    tokens: Tokens = field(default_factory=Tokens)
    recordings: Path | None = None
    origins: tuple[str, ...] = ()  # of other pages that may connect
    certificate: Path | None = None
    private_key: Path | None = None
    once: bool = False  # ends with its race
    limits: GatewayLimits = field(default_factory=GatewayLimits)
    timing: GatewayTiming = field(default_factory=GatewayTiming)

    @property
    def is_local(self) -> bool:
        """Whether only this machine can reach it."""
        return is_loopback(self.host)


def place_of(words: str) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT``.

    Raises:
        LinkError: it is written in another way.
    """
    host, _, port = words.rpartition(":")
    if not host or not port.isdecimal() or int(port) > 65535:
        raise LinkError(f"--listen {words!r}: write HOST:PORT, such as {DEFAULT_PLACE}")
    return host.strip("[]"), int(port)


def tokens_for(
    *, drivers: int, steward: bool, open_to_all: bool, companions: Iterable[int] = ()
) -> Tokens:
    """Return new tokens. open_to_all: spectators need none; companions: of these seats."""
    return Tokens(
        spectate="" if open_to_all else new_token(),
        drive=tuple(new_token() for _ in range(drivers)),
        steward=new_token() if steward else "",
        companion=tuple((seat, new_token()) for seat in sorted(set(companions))),
    )


def check_settings(settings: Settings, *, is_open: bool) -> None:
    """Do nothing for settings that let no browser in by mistake.

    Raises:
        LinkError: other machines could reach it, and it is not open.
        KeysError: other machines could watch without a token, or the certificate cannot be used.
    """
    if not settings.is_local and not is_open:
        raise LinkError(
            f"{settings.host} can be reached from other machines: say so with --open, or listen "
            f"on this machine only, such as {DEFAULT_PLACE}"
        )
    if not settings.is_local and not settings.tokens.spectate:
        raise KeysError("beyond this machine spectators need a token: --spectators token")
    if (settings.certificate is None) != (settings.private_key is None):
        raise KeysError("--certificate and --key come together")
    if settings.certificate is not None:
        _check_certificate(settings.certificate, settings.private_key)


def _check_certificate(certificate: Path, private_key: Path | None) -> None:
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, private_key)
    except OSError as error:  # ssl.SSLError is one
        raise KeysError(
            f"{certificate} and {private_key} cannot be used: missing, damaged, or they do not "
            f"belong together ({error.strerror or error})"
        ) from error


@dataclass(frozen=True)
class Addresses:
    """The addresses to open. Tokens are behind the #, so that browsers send them to no server."""

    base: str
    watch: str
    drive: tuple[str, ...]
    steward: str  # "" where there is none
    companion: tuple[str, ...] = ()


def addresses_of(settings: Settings, port: int) -> Addresses:
    """Return the addresses of a gateway that listens on a port."""
    scheme = "https" if settings.certificate else "http"
    # The wildcard address cannot be opened in a browser.
    name = socket.gethostname() if settings.host in _EVERYWHERE else settings.host
    host = f"[{name}]" if ":" in name else name
    base, tokens = f"{scheme}://{host}:{port}/", settings.tokens
    return Addresses(
        base,
        f"{base}#watch" + (f"&token={tokens.spectate}" if tokens.spectate else ""),
        tuple(f"{base}#drive&token={token}" for token in tokens.drive),
        f"{base}#steward&token={tokens.steward}" if tokens.steward else "",
        tuple(f"{base}#beside&token={token}" for _, token in tokens.companion),
    )
