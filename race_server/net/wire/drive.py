"""Encode and decode control, observation and heads-up data of one seat.

The fast encoders patch a message that the generated code built once; the bytes are the same.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from operator import attrgetter

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.core.messages import Button, Control, Flag, PoseFault, Trust
from race_server.errors import Reason, WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.drive import Control as ControlStruct
from race_server.net.wire.generated.drive import ControlMessage, Effect, Hud, SeatObservation
from race_server.net.wire.strict import F32, U8, U16, U32, U64, Table, root_of

CONTROL = struct.Struct("<IIIfffI")
EFFECT = np.dtype([("item", "<u4"), ("remaining", "<f4")])
MOST_VALUES = 8192
MOST_EFFECTS = 16
_KNOWN_BUTTONS = int(Button.USE_ITEM | Button.ACCEPT_RESCUE)


@dataclass(frozen=True, slots=True)
class ControlFrame:
    """A control with the epoch, sequence and tick of its decision."""

    epoch: int
    sequence: int
    tick: int
    control: Control


@dataclass(frozen=True, slots=True)
class ObservationFrame:
    """An observation with its epoch, tick and seat."""

    epoch: int
    tick: int
    acknowledged: int
    seat: int
    values: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class HudFrame:
    """The limits of effects and flags on a kart, and its items."""

    epoch: int
    tick: int
    speed_cap: float
    thrust_scale: float
    grip_scale: float
    item: int
    immune_s: float
    effects: NDArray[np.void]  # EFFECT
    sequence: int = 0
    valid_s: float = 0.0
    monotonic_us: int = 0
    lights_s: float = 0.0
    flag: Flag = Flag.GREEN
    trust: Trust = Trust.SIMULATED
    fault: PoseFault = PoseFault.NONE
    is_led: bool = False  # the parking driver of the server has the wheel


def encode_control(frame: ControlFrame) -> bytes:
    """Return a control as a message."""
    template, place = _control_template()
    control = frame.control
    data = bytearray(template)
    CONTROL.pack_into(
        data,
        place,
        frame.epoch,
        frame.sequence,
        frame.tick,
        control.steering,
        control.throttle,
        control.brake,
        int(control.buttons),
    )
    return bytes(data)


def build_control(frame: ControlFrame) -> bytes:
    """Return a control as the generated code encodes it: the reference for `encode_control`."""
    builder = flatbuffers.Builder(64)
    control = frame.control
    ControlMessage.Start(builder)
    ControlMessage.AddControl(
        builder,
        ControlStruct.CreateControl(
            builder,
            frame.epoch,
            frame.sequence,
            frame.tick,
            control.steering,
            control.throttle,
            control.brake,
            int(control.buttons),
        ),
    )
    builder.Finish(ControlMessage.End(builder), topics.CONTROL.identifier)
    return bytes(builder.Output())


@cache
def _control_template() -> tuple[bytes, int]:
    data = build_control(ControlFrame(0, 0, 0, Control()))
    return data, root_of(data, topics.CONTROL.identifier, 256).field(0, CONTROL.size)


def decode_control(data: bytes) -> ControlFrame:
    """Return the control in a message.

    Raises:
        WireError: damaged, oversized, foreign, not finite or out of range; nothing else.
    """
    table = root_of(data, topics.CONTROL.identifier, topics.CONTROL.most_bytes)
    numbers = table.packed(0, CONTROL, "control")
    epoch, sequence, tick, steering, throttle, brake, buttons = numbers
    # Comparisons with NaN are false, so NaN is refused here too.
    if not (-1.0 <= steering <= 1.0 and -1.0 <= throttle <= 1.0 and 0.0 <= brake <= 1.0):
        raise WireError(
            f"control out of range: {steering}, {throttle}, {brake}", Reason.OUT_OF_RANGE
        )
    if buttons > _KNOWN_BUTTONS:
        raise WireError(f"unknown buttons {buttons:#x}", Reason.OUT_OF_RANGE)
    return ControlFrame(epoch, sequence, tick, Control(steering, throttle, brake, Button(buttons)))


class ObservationWriter:
    """Writes observations of one size into one preallocated message."""

    def __init__(self, size: int) -> None:
        self._data = bytearray(
            build_observation(ObservationFrame(0, 0, 0, 0, np.zeros(size, np.float32)))
        )
        table = root_of(bytes(self._data), topics.OBSERVATION.identifier, 1 << 20)
        self._places = [table.field(slot, 4) for slot in range(3)]
        self._seat = table.field(3, 2)
        first, _ = table.vector(4, 4, size)
        self._values = np.frombuffer(self._data, "<f4", size, first)

    def write(
        self, epoch: int, tick: int, acknowledged: int, seat: int, values: NDArray[np.float32]
    ) -> bytes:
        """Return an observation as a message."""
        for place, value in zip(self._places, (epoch, tick, acknowledged), strict=True):
            U32.pack_into(self._data, place, value)
        U16.pack_into(self._data, self._seat, seat)
        self._values[:] = values
        return bytes(self._data)


def build_observation(frame: ObservationFrame) -> bytes:
    """Return an observation as the generated code encodes it."""
    builder = flatbuffers.Builder(256 + 4 * len(frame.values))
    builder.ForceDefaults(True)
    values = builder.CreateNumpyVector(np.ascontiguousarray(frame.values, "<f4"))
    SeatObservation.Start(builder)
    SeatObservation.AddEpoch(builder, frame.epoch)
    SeatObservation.AddTick(builder, frame.tick)
    SeatObservation.AddAcknowledged(builder, frame.acknowledged)
    SeatObservation.AddSeat(builder, frame.seat)
    SeatObservation.AddValues(builder, values)
    builder.Finish(SeatObservation.End(builder), topics.OBSERVATION.identifier)
    return bytes(builder.Output())


def decode_observation(data: bytes) -> ObservationFrame:
    """Return the observation in a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.OBSERVATION.identifier, topics.OBSERVATION.most_bytes)
    first, count = table.vector(4, 4, MOST_VALUES)
    values = np.frombuffer(data, "<f4", count, first)
    return ObservationFrame(
        table.scalar(0, U32),
        table.scalar(1, U32),
        table.scalar(2, U32),
        table.scalar(3, U16),
        values,
    )


Place = tuple[Callable[..., None], int]

# Slot and layout of each number of heads-up data.
_HUD = {
    "epoch": (0, U32),
    "tick": (1, U32),
    "speed_cap": (2, F32),
    "thrust_scale": (3, F32),
    "grip_scale": (4, F32),
    "item": (5, U8),
    "immune_s": (6, F32),
    "sequence": (8, U32),
    "valid_s": (9, F32),
    "monotonic_us": (10, U64),
    "lights_s": (11, F32),
    "flag": (12, U8),
    "trust": (13, U8),
    "fault": (14, U8),
    "is_led": (15, U8),
}
_numbers_of = attrgetter(*_HUD)


class HudWriter:
    """Writes heads-up data into preallocated messages, one for each count of effects."""

    def __init__(self) -> None:
        self._templates: dict[int, tuple[bytearray, list[Place], NDArray[np.void]]] = {}

    def write(self, frame: HudFrame) -> bytes:
        """Return heads-up data as a message."""
        count = len(frame.effects)
        template = self._templates.get(count)
        if template is None:
            template = self._templates[count] = _hud_template(frame)
        data, places, effects = template
        for (pack_into, place), value in zip(places, _numbers_of(frame), strict=True):
            pack_into(data, place, value)
        if count:
            effects[:] = frame.effects
        return bytes(data)


def _hud_template(frame: HudFrame) -> tuple[bytearray, list[Place], NDArray[np.void]]:
    data = bytearray(encode_hud(frame, is_whole=True))
    table = root_of(bytes(data), topics.HUD.identifier, topics.HUD.most_bytes)
    places = [(layout.pack_into, table.field(slot, layout.size)) for slot, layout in _HUD.values()]
    first, count = table.vector(7, EFFECT.itemsize, MOST_EFFECTS)
    return data, places, np.frombuffer(data, EFFECT, count, first)


def encode_hud(frame: HudFrame, *, is_whole: bool = False) -> bytes:
    """Return heads-up data as the generated code encodes it: the reference for `HudWriter`.

    is_whole: with the fields that have the value which is read where they are missing.
    """
    builder = flatbuffers.Builder(256)
    builder.ForceDefaults(is_whole)
    Hud.StartEffectsVector(builder, len(frame.effects))
    for row in frame.effects[::-1]:
        Effect.CreateEffect(builder, int(row["item"]), float(row["remaining"]))
    effects = builder.EndVector()
    Hud.Start(builder)
    Hud.AddEpoch(builder, frame.epoch)
    Hud.AddTick(builder, frame.tick)
    Hud.AddSpeedCap(builder, frame.speed_cap)
    Hud.AddThrustScale(builder, frame.thrust_scale)
    Hud.AddGripScale(builder, frame.grip_scale)
    Hud.AddItem(builder, frame.item)
    Hud.AddImmune(builder, frame.immune_s)
    Hud.AddEffects(builder, effects)
    Hud.AddSequence(builder, frame.sequence)
    Hud.AddValid(builder, frame.valid_s)
    Hud.AddMonotonic(builder, frame.monotonic_us)
    Hud.AddLights(builder, frame.lights_s)
    Hud.AddFlag(builder, int(frame.flag))
    Hud.AddTrust(builder, int(frame.trust))
    Hud.AddFault(builder, int(frame.fault))
    Hud.AddLed(builder, frame.is_led)
    builder.Finish(Hud.End(builder), topics.HUD.identifier)
    return bytes(builder.Output())


def decode_hud(data: bytes) -> HudFrame:
    """Return the heads-up data in a message.

    Raises:
        WireError: damaged or foreign.
    """
    table: Table = root_of(data, topics.HUD.identifier, topics.HUD.most_bytes)
    first, count = table.vector(7, EFFECT.itemsize, MOST_EFFECTS)
    effects = np.frombuffer(data, EFFECT, count, first)
    if not np.isfinite(effects["remaining"]).all():
        raise WireError("remaining time of an effect is not finite")
    cap, thrust, grip, immune, valid, lights = (
        table.number(slot, F32) for slot in (2, 3, 4, 6, 9, 11)
    )
    if min(cap, thrust, grip, immune, valid, lights) < 0.0 or not math.isfinite(cap):
        raise WireError("heads-up data out of range")
    flag, trust, fault = (table.scalar(slot, U8) for slot in (12, 13, 14))
    if flag > max(Flag) or trust > max(Trust) or fault > max(PoseFault):
        raise WireError(f"heads-up data of flag {flag}, trust {trust} and pose fault {fault}")
    return HudFrame(
        epoch=table.scalar(0, U32),
        tick=table.scalar(1, U32),
        speed_cap=cap,
        thrust_scale=thrust,
        grip_scale=grip,
        item=table.scalar(5, U8),
        immune_s=immune,
        effects=effects,
        sequence=table.scalar(8, U32),
        valid_s=valid,
        monotonic_us=table.scalar(10, U64),
        lights_s=lights,
        flag=Flag(flag),
        trust=Trust(trust),
        fault=PoseFault(fault),
        is_led=table.scalar(15, U8) > 0,
    )
