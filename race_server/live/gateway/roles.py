"""Who a browser may be: tokens that were handed out, and words by which it comes back."""

import secrets
from collections import OrderedDict
from dataclasses import dataclass

from race_server.errors import GatewayError
from race_server.live.gateway.handshake import Hello, Role

# So many words for coming back are kept of each role.
MOST_PASSES = 1024


def new_token() -> str:
    """Return a token that nobody guesses."""
    return secrets.token_urlsafe(16)


@dataclass(frozen=True)
class Identity:
    """Who somebody is here."""

    role: Role
    wheel: int = -1  # of a driver: number of its token
    name: str = ""


@dataclass(frozen=True)
class Tokens:
    """What opens each role."""

    spectate: str = ""  # "" lets anybody watch
    drive: tuple[str, ...] = ()  # one for each driver
    steward: str = ""  # "" for nobody

    def identify(self, hello: Hello) -> Identity:
        """Return who shows a token.

        Raises:
            GatewayError: it does not fit.
        """
        if hello.role is Role.SPECTATE:
            if not self.spectate or _fits(hello.token, self.spectate):
                return Identity(hello.role, name=hello.name)
        elif hello.role is Role.DRIVE:
            # All are compared, so that the time taken tells nothing.
            fits = [_fits(hello.token, token) for token in self.drive]
            if any(fits):
                return Identity(hello.role, fits.index(True), hello.name)
        elif self.steward and _fits(hello.token, self.steward):
            return Identity(hello.role, name=hello.name)
        raise GatewayError(
            "token",
            f"the token does not fit the role {hello.role.value}; open the address that the "
            "gateway has printed",
        )

    def lets_read(self, token: str) -> bool:
        """Return whether whoever shows a token may look at what spectators see."""
        known = (self.spectate, self.steward, *self.drive)
        fits = [_fits(token, one) for one in known if one]
        return not self.spectate or any(fits)


def _fits(shown: str, token: str) -> bool:
    # JSON may hold halves of characters, which are no text.
    return secrets.compare_digest(shown.encode(errors="surrogatepass"), token.encode())


class ResumeTokens:
    """Words by which browsers come back after a break, each good for one time."""

    def __init__(self) -> None:
        """Begin with none."""
        # Those of one role cannot push out those of another.
        self._open: dict[Role, OrderedDict[str, Identity]] = {role: OrderedDict() for role in Role}

    def issue(self, identity: Identity) -> str:
        """Return a new word for somebody."""
        word, kept = new_token(), self._open[identity.role]
        kept[word] = identity
        if len(kept) > MOST_PASSES:
            kept.popitem(last=False)
        return word

    def look(self, word: str) -> Identity:
        """Return who a word is for, and leave it as it is.

        Raises:
            GatewayError: it was used already, or nobody was given it.
        """
        for kept in self._open.values():
            if word in kept:
                return kept[word]
        raise GatewayError(
            "used",
            "this word for coming back was used already, or is an earlier gateway's; open the "
            "page's address again",
        )

    def spend(self, word: str) -> None:
        """Let a word count no longer."""
        for kept in self._open.values():
            kept.pop(word, None)
