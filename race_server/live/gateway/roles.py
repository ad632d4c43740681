"""Roles of browsers: tokens that open them, and tokens that resume them after a break."""

import secrets
from collections import OrderedDict
from dataclasses import dataclass

from race_server.errors import GatewayError
from race_server.live.gateway.handshake import Hello, Role


def new_token() -> str:
    """Return a token that cannot be guessed."""
    return secrets.token_urlsafe(16)


@dataclass(frozen=True)
class Identity:
    """The role of a browser."""

    role: Role
    number: int = -1  # of a driver's token; of a companion the seat
    name: str = ""


@dataclass(frozen=True)
class Tokens:
    """The token of each role."""

    spectate: str = ""  # "" lets all browsers watch
    drive: tuple[str, ...] = ()  # one for each driver
    steward: str = ""  # "" lets no browser steward
    companion: tuple[tuple[int, str], ...] = ()  # seat and token of each

    def identify(self, hello: Hello) -> Identity:
        """Return the role that a token opens.

        Raises:
            GatewayError: it does not fit.
        """
        if hello.role is Role.SPECTATE:
            if not self.spectate or _fits(hello.token, self.spectate):
                return Identity(hello.role, name=hello.name)
        elif hello.role is Role.DRIVE:
            # All are compared, so that the time taken reveals nothing.
            fits = [_fits(hello.token, token) for token in self.drive]
            if any(fits):
                return Identity(hello.role, fits.index(True), hello.name)
        elif hello.role is Role.COMPANION:
            seats = [seat for seat, token in self.companion if _fits(hello.token, token)]
            if seats:
                return Identity(hello.role, seats[0], hello.name)
        elif self.steward and _fits(hello.token, self.steward):
            return Identity(hello.role, name=hello.name)
        raise GatewayError(
            "token",
            f"the token does not fit the role {hello.role.value}; open the address that the "
            "gateway has printed",
        )

    def lets_read(self, token: str) -> bool:
        """Return whether a token lets its bearer read what spectators see."""
        beside = (token for _, token in self.companion)
        known = (self.spectate, self.steward, *self.drive, *beside)
        fits = [_fits(token, one) for one in known if one]
        return not self.spectate or any(fits)


def _fits(shown: str, token: str) -> bool:
    return secrets.compare_digest(shown.encode(), token.encode())


class ResumeTokens:
    """Tokens with which browsers resume after a break, each valid once."""

    def __init__(self, most_per_role: int) -> None:
        """Begin with none. most_per_role: that are valid at once; the oldest expire."""
        self._most = most_per_role
        # Many tokens of one role do not make those of another expire.
        self._open: dict[Role, OrderedDict[str, Identity]] = {role: OrderedDict() for role in Role}

    def issue(self, identity: Identity) -> str:
        """Return a new token for a browser."""
        token, kept = new_token(), self._open[identity.role]
        kept[token] = identity
        if len(kept) > self._most:
            kept.popitem(last=False)
        return token

    def find(self, token: str) -> Identity:
        """Return the browser that a token was issued to; the token stays valid.

        Raises:
            GatewayError: it was used already, has expired, or was never issued.
        """
        for kept in self._open.values():
            if token in kept:
                return kept[token]
        raise GatewayError(
            "used",
            "this word for coming back was used already, or is an earlier gateway's; open the "
            "page's address again",
        )

    def revoke(self, token: str) -> None:
        """Make a token invalid."""
        for kept in self._open.values():
            kept.pop(token, None)
