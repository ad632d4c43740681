"""A watchdog of the server: where its loop hangs the process ends, and a supervisor restarts it."""

import faulthandler
import math
import time

# Exit status of a process that the watchdog has ended: `faulthandler` gives no other.
HUNG = 1
# A loop that has not turned for this long hangs [s].
HUNG_S = 10.0
# The watchdog is set again this often [s].
SET_S = 1.0


class Watchdog:
    """Ends this process once its loop has not turned for a time.

    A thread in C does it, so it needs neither the interpreter lock nor the main thread, either of
    which a driver that never returns may hold. Before the end it writes to stderr where each thread
    was.
    """

    def __init__(self, hung_s: float = math.inf) -> None:
        """Begin at rest. hung_s: infinite for a watchdog that never bites."""
        self.hung_s = hung_s
        self._set_at = -math.inf

    def turn(self) -> None:
        """Note that the loop turns; set the watchdog, if it was set long enough ago."""
        now = time.monotonic()
        if math.isfinite(self.hung_s) and now - self._set_at > SET_S:
            self._set_at = now
            faulthandler.dump_traceback_later(self.hung_s, exit=True)

    def rest(self) -> None:
        """Stop watching until the next turn: what comes may take its time, such as a disk."""
        if math.isfinite(self._set_at):
            self._set_at = -math.inf
            faulthandler.cancel_dump_traceback_later()

    @property
    def outlook(self) -> str:
        """What happens to a loop that stands, as the end of a sentence."""
        return f"; after {self.hung_s:g} s its process ends" if math.isfinite(self.hung_s) else ""
