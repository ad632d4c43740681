"""A steward's client: asks a session for what only a steward may do."""

from typing import Any

from race_server.errors import SeatError
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.admin import Decision, decode_log, encode_decision
from race_server.net.wire.lobby import check_reply

# How often a decision is sent while others come first.
TRIES = 5


class StewardClient:
    """Sends a steward's decisions to a server."""

    def __init__(self, link: ClientLink, token: str, who: str = "steward") -> None:
        """Use a link.

        token: from the steward's keys, or from the file that the server has written. who: name in
        the log.
        """
        self._link = link
        self._token = token
        self._who = who

    def decide(self, act: str, **what: Any) -> str:
        """Send a decision and return its line of the log. what: the other fields of `Decision`.

        Raises:
            SeatError: the server refuses, with its reason.
            LinkError: no answer.
        """
        challenge, _ = self._ask()
        for left in reversed(range(TRIES)):
            decision = Decision(self._token, act, challenge=challenge, who=self._who, **what)
            try:
                check_reply(self._link.ask(topics.ACT, encode_decision(decision)))
                break
            except SeatError:
                sent, (challenge, _) = challenge, self._ask()
                if challenge == sent or not left:
                    raise
        return self.log()[-1]

    def log(self) -> list[str]:
        """Return the log of decisions, oldest first.

        Raises:
            SeatError: the token does not fit.
            LinkError: no answer.
        """
        return self._ask()[1]

    def _ask(self) -> tuple[int, list[str]]:
        request = encode_decision(Decision(self._token, "log", who=self._who))
        return decode_log(self._link.ask(topics.ACTS, request))
