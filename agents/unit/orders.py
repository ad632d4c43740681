"""What the game wants of a kart, in the shape in which its control unit reads it."""

from dataclasses import dataclass
from typing import Protocol

from race_server.core.messages import Flag, Trust


class Orders(Protocol):
    """The newest word of the server, whatever message it came in."""

    @property
    def epoch(self) -> int:
        """Number of the race."""

    @property
    def tick(self) -> int:
        """1/60 s since the countdown began."""

    @property
    def sequence(self) -> int:
        """Rises with every change."""

    @property
    def speed_cap(self) -> float:
        """Fastest speed that is allowed [m/s]."""

    @property
    def thrust_scale(self) -> float:
        """Share of the motor's force that is left [-]."""

    @property
    def grip_scale(self) -> float:
        """Share of the grip that effects leave [-]."""

    @property
    def valid_s(self) -> float:
        """Time for which the orders hold [s]."""

    @property
    def monotonic_us(self) -> int:
        """Server's clock [µs]."""

    @property
    def lights_s(self) -> float:
        """Time until the start [s], 0 once the race runs."""

    @property
    def flag(self) -> Flag:
        """Flag that is shown to this kart."""

    @property
    def trust(self) -> Trust:
        """How its poses are taken."""


@dataclass(frozen=True)
class GivenOrders:
    """Orders as plain numbers."""

    speed_cap: float
    thrust_scale: float
    epoch: int = 1
    tick: int = 1
    sequence: int = 1
    grip_scale: float = 1.0
    valid_s: float = 0.5
    monotonic_us: int = 0
    lights_s: float = 0.0
    flag: Flag = Flag.GREEN
    trust: Trust = Trust.TRUSTED
