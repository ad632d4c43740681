"""How long a server waits for what."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ServerTiming:
    """The timeouts and periods of a server, all in seconds."""

    answer_s: float = 10.0  # in lockstep a driver that does not answer for this long is gone
    repeat_s: float = 0.5  # it is sent its observation again this often: one may be lost
    poll_s: float = 0.02  # between two looks at the link where no time passes
    show_up_s: float = 10.0  # a seat in the lobby is free again if its driver's link does not come
    see_off_s: float = 5.0  # drivers have this long to receive the end of the last race
    hold_s: float = 3.0  # an announcement waits at most this long for the disk
    orders_s: float = 0.5  # a real kart without newer orders than this stops by itself
    log_s: float = 0.1  # between two looks at the session for the log
    sum_up_s: float = 60.0  # between two lines of the log on missed ticks
    still_s: float = 1.0  # a loop that has not turned for this long is not healthy
