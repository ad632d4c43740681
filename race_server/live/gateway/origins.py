"""Which pages may talk to the gateway: its own, and those that were named."""

import ipaddress
from collections.abc import Mapping
from urllib.parse import urlsplit

from race_server.errors import GatewayError


def is_loopback(host: str) -> bool:
    """Return whether an address is of this machine."""
    try:
        return ipaddress.ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return host == "localhost"


def check_origin(headers: Mapping[str, str], origins: tuple[str, ...], *, is_local: bool) -> None:
    """Do nothing for a connection of our own page, or of no page at all.

    Browsers always say from which page a connection comes; other programs do not, and could lie.
    origins: of other pages that may connect; is_local: only this machine can reach the gateway,
    so a page that reaches it under another name was sent here by somebody's name server.

    Raises:
        GatewayError: it is another page's.
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
    """Return whether a name, as browsers give it, is this machine's own or one of the pages'."""
    _, name = _named(f"//{host}")
    return is_loopback(name) or name in {_named(origin)[1] for origin in origins}


def _named(address: str) -> tuple[str, str]:
    """Return ``host:port`` and host of an address; nothing of one that is none."""
    try:
        parts = urlsplit(address)
        return parts.netloc.lower(), parts.hostname or ""
    except ValueError:
        return "", ""
