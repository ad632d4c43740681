"""What is done to a race from outside other than by a driver's control.

An act is a number and takes effect between two ticks, so a recording can hold it and a replay can
do it again. A new kind is a new row of the table at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from race_server.core import codes
from race_server.core.stages.events import penalise, report
from race_server.core.state import World
from race_server.core.step import remove, show_flag, withdraw
from race_server.session.parking import send_to


class InterventionKind(IntEnum):
    """What is done; the numbers stand in recordings, so they keep their meaning."""

    WITHDRAW = 1  # a kart is out of the race
    FLAG = 2  # value: Flag
    PENALTY = 3  # value: [s] that the stewards add to a kart's race time; below 0: take back
    CLOSE = 4  # no driver may take a kart's seat; value: 1 where its driver was sent away
    OPEN = 5  # it may be taken again
    CLOCK = 6  # value: 1 the clock stands, 0 it goes on
    PARK = 7  # a vehicle is told to park; value: number of the slot, -1 for the one that it has
    WHEEL = 8  # value: 1 the server's parking driver takes the wheel, 0 gives it back
    REMOVE = 9  # stewards take a kart out of the race; value: Fault


# Those that concern one kart.
ON_KARTS = (
    InterventionKind.WITHDRAW,
    InterventionKind.PENALTY,
    InterventionKind.CLOSE,
    InterventionKind.OPEN,
    InterventionKind.PARK,
    InterventionKind.WHEEL,
    InterventionKind.REMOVE,
)


@dataclass(frozen=True, slots=True)
class Intervention:
    """Something done before a tick."""

    tick: int
    kind: InterventionKind
    kart: int = -1
    value: float = 0.0


def carry_out(world: World, act: Intervention) -> None:
    """Do to the only race of a world what an act does to it."""
    _ACTS[act.kind](world, act.kart, act.value)


def _withdraw(world: World, kart: int, _: float) -> None:
    withdraw(world, 0, kart)


def _remove(world: World, kart: int, fault: float) -> None:
    remove(world, 0, kart, int(fault))


def _show_flag(world: World, _: int, flag: float) -> None:
    show_flag(world, 0, int(flag))


def _penalise(world: World, kart: int, seconds: float) -> None:
    racer, given_us = world.racers[0, kart], round(seconds * 1e6)
    if given_us >= 0:
        penalise(world, 0, kart, given_us, codes.EVENT_PENALTY)
        return
    back_us = min(-given_us, int(racer.penalty_us))
    racer.penalty_us -= back_us
    left = int(racer.penalties) - 1
    racer.penalties = max(left, 1) if racer.penalty_us > 0 else 0
    report(world, 0, codes.EVENT_PENALTY, kart, codes.EVENT_PENALTY, -back_us)


def _park(world: World, kart: int, slot: float) -> None:
    send_to(world, kart, int(slot))


def _leave(_world: World, _kart: int, _value: float) -> None:
    """Do nothing: such an act concerns the session, and karts drive no differently."""


_ACTS: dict[InterventionKind, Callable[[World, int, float], None]] = {
    InterventionKind.WITHDRAW: _withdraw,
    InterventionKind.FLAG: _show_flag,
    InterventionKind.PENALTY: _penalise,
    InterventionKind.CLOSE: _leave,
    InterventionKind.OPEN: _leave,
    InterventionKind.CLOCK: _leave,
    InterventionKind.PARK: _park,
    InterventionKind.WHEEL: _leave,
    InterventionKind.REMOVE: _remove,
}
