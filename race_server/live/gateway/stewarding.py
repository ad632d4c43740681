"""A steward's decisions in a browser, sent to the race."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from functools import partial
from typing import Any, TypeVar

from race_server.errors import RaceError, SeatError
from race_server.live.client.steward import StewardClient
from race_server.net.transport import ClientLink

Answer = TypeVar("Answer")

# Decisions that a steward may send; see `race_server.live.server.steward`.
ACTS = (
    *("flag", "pause", "resume", "penalty", "kick", "remove", "close", "open", "restart", "park"),
    *("protest", "uphold", "dismiss", "disqualify"),
)


class Stewarding:
    """Sends decisions to the race, one after the other."""

    def __init__(
        self, connect: Callable[[], ClientLink], token: Callable[[], str], pool: Executor
    ) -> None:
        """Prepare. connect: returns a link; token: the race's, which every new server changes."""
        self._connect, self._token, self._pool = connect, token, pool
        self._busy = asyncio.Lock()
        self._link: ClientLink | None = None

    async def decide(self, act: str, who: str, **what: Any) -> str:
        """Send a decision and return why it was refused, nothing where it was not.

        what: the other fields of a `Decision`.
        """
        if act not in ACTS:
            return f"a steward cannot {act!r}; choose one of {', '.join(ACTS)}"
        return await self._decide(act, who, **what)

    async def use_item(self, seat: int) -> str:
        """Press the item button of a seat for a person beside its driver; return as `decide`."""
        return await self._decide("use", f"beside seat {seat}", seat=seat)

    async def protest(self, seat: int, against: int, why: str) -> str:
        """Lodge a protest of the driver of a seat; return as `decide`."""
        who = f"driver of seat {seat}"
        return await self._decide("protest", who, seat=seat, against=against, note=why)

    async def log(self, who: str) -> list[str]:
        """Return the log of decisions, oldest first.

        Raises:
            RaceError: the race refuses, or does not answer.
        """
        return await self._ask(StewardClient.log, who)

    async def close(self) -> None:
        """Close the link."""
        async with self._busy:
            self._drop()

    async def _decide(self, act: str, who: str, **what: Any) -> str:
        try:
            await self._ask(lambda client: client.decide(act, **what), who)
        except RaceError as error:
            return str(error)
        return ""

    async def _ask(self, ask: Callable[[StewardClient], Answer], who: str) -> Answer:
        async with self._busy:
            work = partial(self._ask_over_link, ask, who or "steward")
            return await asyncio.get_running_loop().run_in_executor(self._pool, work)

    def _ask_over_link(self, ask: Callable[[StewardClient], Answer], who: str) -> Answer:
        """Ask; runs in the pool, one at a time."""
        if self._link is None:
            self._link = self._connect()
        try:
            return ask(StewardClient(self._link, self._token(), who))
        except SeatError:
            raise  # the race has answered, so the link works
        except RaceError:
            self._drop()
            raise

    def _drop(self) -> None:
        if self._link is not None:
            self._link.close()
            self._link = None
