"""What is done to a race from outside other than by a driver's control.

An act is a number and takes effect between two ticks, so a recording can hold it and a replay can
do it again. A new kind is a new row of the table at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from race_server import codes
from race_server.stages.report import penalise
from race_server.state import World
from race_server.step import show_flag, withdraw


class ActKind(IntEnum):
    """What is done; the numbers stand in recordings, so they keep their meaning."""

    WITHDRAW = 1  # a kart is out of the race
    FLAG = 2  # value: Flag
    PENALTY = 3  # value: [s] that the stewards add to a kart's race time


@dataclass(frozen=True, slots=True)
class Act:
    """Something done before a tick."""

    tick: int
    kind: ActKind
    kart: int = -1
    value: float = 0.0


def carry_out(world: World, act: Act) -> None:
    """Do it to the only race of a world."""
    _ACTS[act.kind](world, act.kart, act.value)


def _withdraw(world: World, kart: int, _: float) -> None:
    withdraw(world, 0, kart)


def _show_flag(world: World, _: int, flag: float) -> None:
    show_flag(world, 0, int(flag))


def _penalise(world: World, kart: int, seconds: float) -> None:
    penalise(world, 0, kart, round(seconds * 1e6), codes.EVENT_PENALTY)


_ACTS: dict[ActKind, Callable[[World, int, float], None]] = {
    ActKind.WITHDRAW: _withdraw,
    ActKind.FLAG: _show_flag,
    ActKind.PENALTY: _penalise,
}
