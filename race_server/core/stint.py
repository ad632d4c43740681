"""A part of a race, as live timing tells it."""

from dataclasses import dataclass

MOST_STINTS = 16  # of a kart; older ones are forgotten


@dataclass(frozen=True)
class Stint:
    """What a kart drives from one stop to the next: it stops where it stands or is rescued."""

    first_lap: int  # from 1
    laps: int  # that it has finished
    best_us: int  # 0: none yet
    items: int  # that it used
