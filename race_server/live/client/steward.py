"""The steward's end: asks a session for what only the steward may."""

from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.admin import Decision, decode_log, encode_decision
from race_server.net.wire.lobby import check_reply


class StewardClient:
    """Tells a server what the steward decided."""

    def __init__(self, link: ClientLink, token: str, who: str = "steward") -> None:
        """Speak over a link.

        token: from the steward's keys, or from the file that the server left. who: a name for
        the log.
        """
        self._link = link
        self._token = token
        self._who = who

    def decide(self, act: str, *, seat: int = -1, value: float = 0.0) -> str:
        """Have a decision carried out and return its line of the log.

        Raises:
            SeatError: the server refuses, with its reason.
            LinkError: no answer.
        """
        challenge, _ = self._ask()
        decision = Decision(self._token, act, seat, value, challenge, self._who)
        check_reply(self._link.ask(topics.ACT, encode_decision(decision)))
        return self.log()[-1]

    def log(self) -> list[str]:
        """Return what was decided, oldest first.

        Raises:
            SeatError: the token does not fit.
            LinkError: no answer.
        """
        return self._ask()[1]

    def _ask(self) -> tuple[int, list[str]]:
        request = encode_decision(Decision(self._token, "log", who=self._who))
        return decode_log(self._link.ask(topics.ACTS, request))
