"""Which driver inside a server's process was asked when the process hung or crashed."""

import mmap
import signal
from collections.abc import Iterator
from contextlib import contextmanager

SEATS = 64
_ASKED, _BARRED = 1, 2
# Signals by which faulty machine code ends its process.
CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGILL, signal.SIGFPE, signal.SIGABRT)


class Suspects:
    """Marks of seats, shared by a supervisor with the processes that it forks.

    A driver during whose decision a process hung or crashed is barred: it would do the same to the
    next process, which takes the same race up.
    """

    def __init__(self) -> None:
        """Begin without a mark."""
        self._marks = mmap.mmap(-1, SEATS)

    @contextmanager
    def asking(self, seat: int) -> Iterator[None]:
        """Mark a seat as asked inside of this."""
        self._marks[seat] = _ASKED
        try:
            yield
        finally:
            self._marks[seat] = 0

    def judge(self, *, is_guilty: bool) -> None:
        """Bar the seats that were asked when a process ended, or clear them."""
        for seat in range(SEATS):
            if self._marks[seat] == _ASKED:
                self._marks[seat] = _BARRED if is_guilty else 0

    def barred(self) -> list[int]:
        """Return the seats whose drivers are not to be asked again."""
        return [seat for seat in range(SEATS) if self.is_barred(seat)]

    def is_barred(self, seat: int) -> bool:
        """Return whether the driver of a seat is not to be asked again."""
        return self._marks[seat] == _BARRED
