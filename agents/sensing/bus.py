"""The kart's CAN bus: sensors in, commands out, as `kart.dbc` lays them out.

Every message ends with a counter and a CRC. A message with a wrong CRC is dropped and counted; one
whose counter stands still is that of a sensor that hangs, and counts as silence.
"""

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import cast

import can
import cantools
from cantools.database import Database, Message

from race_agents.unit.safety import Command

LAYOUT = Path(__file__).with_name("kart.dbc")
MOTION, FELT, COMMAND = "MOTION", "FELT", "COMMAND"
SENSORS = (MOTION, FELT)
# CRC-8 SAE J1850.
POLYNOMIAL, BEGIN, FLIP = 0x1D, 0xFF, 0xFF
# Without a fresh message for this long [s] a sensor is silent.
SILENT_S = 0.05


@cache
def layout() -> Database:
    """Return the layout of all messages."""
    return cast("Database", cantools.database.load_file(LAYOUT))


@cache
def _table() -> tuple[int, ...]:
    rows = []
    for value in range(256):
        for _ in range(8):
            value = (value << 1) ^ POLYNOMIAL if value & 0x80 else value << 1
        rows.append(value & 0xFF)
    return tuple(rows)


def check_of(number: int, data: bytes) -> int:
    """Return the CRC of a message: over its number, low byte first, and its bytes but the last."""
    crc, table = BEGIN, _table()
    for byte in (number & 0xFF, number >> 8, *data[:-1]):
        crc = table[crc ^ byte]
    return crc ^ FLIP


def message_of(name: str, values: dict[str, float], counter: int) -> can.Message:
    """Return a message with its counter and its CRC; values beyond their range are cut off."""
    kind: Message = layout().get_message_by_name(name)
    kept = {
        signal.name: min(max(values[signal.name], float(signal.minimum)), float(signal.maximum))
        for signal in kind.signals
        if signal.name in values and signal.minimum is not None and signal.maximum is not None
    }
    data = bytearray(kind.encode({**kept, "Counter": counter % 256, "Check": 0}))
    data[-1] = check_of(kind.frame_id, bytes(data))
    return can.Message(arbitration_id=kind.frame_id, data=data, is_extended_id=False)


@dataclass
class BusReader:
    """What the sensors on the bus say, and whether they still do."""

    damaged: int = 0
    unknown: int = 0
    _values: dict[str, dict[str, float]] = field(default_factory=dict)
    _heard_s: dict[str, float] = field(default_factory=dict)
    _counters: dict[str, int] = field(default_factory=dict)

    def take(self, message: can.Message, now_s: float) -> None:
        """Take a message of the bus."""
        try:
            kind = layout().get_message_by_frame_id(message.arbitration_id)
        except KeyError:
            self.unknown += 1
            return
        if len(message.data) != kind.length or message.data[-1] != check_of(
            kind.frame_id, bytes(message.data)
        ):
            self.damaged += 1
            return
        values = cast("dict[str, float]", kind.decode(bytes(message.data), decode_choices=False))
        counter = int(values["Counter"])
        if self._counters.get(kind.name) == counter:
            return  # it hangs: nothing new
        self._counters[kind.name] = counter
        self._values[kind.name], self._heard_s[kind.name] = values, now_s

    def silent(self, now_s: float) -> list[str]:
        """Return the sensors that have said nothing new for too long."""
        never = float("-inf")
        return [name for name in SENSORS if now_s - self._heard_s.get(name, never) > SILENT_S]

    def motion(self) -> tuple[float, float, float] | None:
        """Return wheel speed [m/s], yaw rate [rad/s] and steering [rad], as they were last told."""
        row = self._values.get(MOTION)
        return None if row is None else (row["WheelSpeed"], row["YawRate"], row["Steering"])

    def felt(self, now_s: float) -> tuple[float, float] | None:
        """Return the acceleration ahead and to the left [m/s²], None where none is new."""
        row = self._values.get(FELT)
        if row is None or FELT in self.silent(now_s):
            return None
        return row["Ahead"], row["Left"]


@dataclass
class BusWriter:
    """Commands to the actuators."""

    bus: can.BusABC
    _counter: int = 0

    def act(self, command: Command) -> None:
        """Send a command."""
        self._counter += 1
        values = {
            "Steering": command.steering,
            "Throttle": command.throttle,
            "Brake": command.brake,
            "Cause": float(command.cause),
        }
        self.bus.send(message_of(COMMAND, values, self._counter))
