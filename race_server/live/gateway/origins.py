"""Which pages may connect to the gateway: its own, and those named in the settings."""

import ipaddress
from collections.abc import Mapping
from urllib.parse import urlsplit

from race_server.errors import GatewayError


def is_loopback(host: str) -> bool:
    """Return whether an address is a loopback address of this machine."""
    try:
        return ipaddress.ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return host == "localhost"


def check_origin(headers: Mapping[str, str], origins: tuple[str, ...], *, is_local: bool) -> None:
    """Do nothing for a connection of the gateway's own page, or of no page.

    Browsers always send the origin of the page; other programs need not, and could send any.
    origins: of other pages that may connect; is_local: only this machine can reach the gateway, so
    a page with another host name was sent here by a name server (DNS rebinding).

    Raises:
        GatewayError: the connection is another page's.
    """
    origin, host = headers.get("origin"), headers.get("host", "")
    if origin is None or origin in origins:
        return
    place, name = _named(origin)
    is_ours = bool(place) and place == host.lower()
    if not is_ours or (is_local and not is_loopback(name)):
        raise GatewayError(
            "origin",
            f"pages of {origin[:80]} may not connect; open the page at the gateway's own address, "
            "or start it with --origin",
        )


def is_known_host(host: str, origins: tuple[str, ...]) -> bool:
    """Return whether a Host header names this machine, or one of the origins."""
    _, name = _named(f"//{host}")
    return is_loopback(name) or name in {_named(origin)[1] for origin in origins}


def _named(address: str) -> tuple[str, str]:
    """Return ``host:port`` and host of an address, empty where it cannot be read."""
    try:
        parts = urlsplit(address)
        return parts.netloc.lower(), parts.hostname or ""
    except ValueError:
        return "", ""
