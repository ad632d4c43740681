"""What real karts tell of themselves, as long as they go on telling it."""

from dataclasses import dataclass, field
from typing import Generic, TypeVar

from race_server.core.clock import MICROSECONDS
from race_server.errors import Reason, WireError

Word = TypeVar("Word")


@dataclass
class Told(Generic[Word]):
    """The newest word of each real kart, of one kind."""

    name: str  # of a word, in errors
    kept_s: float  # after this time without another [s] a word holds no more
    by_seat: dict[int, Word] = field(default_factory=dict)
    _arrived_us: dict[int, int] = field(default_factory=dict)
    _sequences: dict[int, int] = field(default_factory=dict)
    _has_news: bool = False

    def receive(self, seat: int, sequence: int, word: Word | None, arrived_us: int) -> None:
        """Receive what a kart tells; None: nothing any more.

        Raises:
            WireError: it is a replay.
        """
        if sequence <= self._sequences.get(seat, 0):
            raise WireError(f"{self.name} {sequence} of seat {seat} again", Reason.AGAIN)
        self._sequences[seat], self._arrived_us[seat] = sequence, arrived_us
        self._has_news |= word is not None or seat in self.by_seat
        if word is not None:
            self.by_seat[seat] = word
        else:
            self.by_seat.pop(seat, None)

    def has_news(self, now_us: int) -> bool:
        """Return whether anything changed since the last call; what was not repeated is over."""
        for seat in [*self.by_seat]:
            if now_us - self._arrived_us[seat] > self.kept_s * MICROSECONDS:
                del self.by_seat[seat]
                self._has_news = True
        news, self._has_news = self._has_news, False
        return news

    def forget(self, seat: int) -> None:
        """Forget a kart that has left."""
        self._has_news |= self.by_seat.pop(seat, None) is not None
        self._sequences.pop(seat, None)
