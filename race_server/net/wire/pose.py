"""Encode and decode the pose of a real kart, as fast and as strictly as a control."""

import math
import struct
from dataclasses import dataclass
from functools import cache

import flatbuffers

from race_server.core.messages import Button, Pose, Source
from race_server.errors import Reason, WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.drive import Pose as PoseStruct
from race_server.net.wire.generated.drive import PoseMessage
from race_server.net.wire.strict import root_of

POSE = struct.Struct("<QQIII9fIB3x")
# Beyond any course and kart: keeps nonsense out of the arithmetic.
MOST_METRES, MOST_SPEED, MOST_RATE = 1e5, 200.0, 100.0
_HIGHEST = (
    *(MOST_METRES, MOST_METRES, 2.0 * math.pi, MOST_SPEED, MOST_SPEED, MOST_RATE, math.pi),
    *(MOST_METRES, 1.0),
)


@dataclass(frozen=True, slots=True)
class PoseFrame:
    """A pose with its epoch and sequence, and the orders that the kart acknowledges."""

    epoch: int
    sequence: int
    acknowledged: int
    pose: Pose
    buttons: Button = Button.NONE


def _numbers(frame: PoseFrame) -> tuple[int | float, ...]:
    pose = frame.pose
    return (
        *(pose.stamp_us, pose.echo_us, frame.epoch, frame.sequence, frame.acknowledged),
        *(pose.x, pose.y, pose.heading, pose.speed, pose.lateral_speed, pose.yaw_rate),
        *(pose.steering, pose.deviation, pose.quality, int(frame.buttons), int(pose.source)),
    )


def encode_pose(frame: PoseFrame) -> bytes:
    """Return a pose as a message."""
    template, place = _template()
    data = bytearray(template)
    POSE.pack_into(data, place, *_numbers(frame))
    return bytes(data)


def build_pose(frame: PoseFrame) -> bytes:
    """Return a pose as the generated code encodes it: the reference for `encode_pose`."""
    builder = flatbuffers.Builder(128)
    PoseMessage.Start(builder)
    PoseMessage.AddPose(builder, PoseStruct.CreatePose(builder, *_numbers(frame)))
    builder.Finish(PoseMessage.End(builder), topics.POSE.identifier)
    return bytes(builder.Output())


@cache
def _template() -> tuple[bytes, int]:
    data = build_pose(PoseFrame(0, 0, 0, Pose(0, 0.0, 0.0, 0.0, 0.0)))
    return data, root_of(data, topics.POSE.identifier, topics.POSE.most_bytes).field(0, POSE.size)


def decode_pose(data: bytes) -> PoseFrame:
    """Return the pose in a message.

    Raises:
        WireError: damaged, oversized, foreign, not finite or out of range; nothing else.
    """
    table = root_of(data, topics.POSE.identifier, topics.POSE.most_bytes)
    row = table.packed(0, POSE, "pose")
    values, buttons, source = row[5:14], row[14], row[15]
    # Comparisons with NaN are false, so NaN is refused here too.
    if not all(-most <= value <= most for value, most in zip(values, _HIGHEST, strict=True)):
        raise WireError(f"pose out of range: {values}", Reason.OUT_OF_RANGE)
    if values[7] < 0.0 or values[8] < 0.0:
        raise WireError(
            f"pose out of range: deviation {values[7]}, quality {values[8]}", Reason.OUT_OF_RANGE
        )
    if buttons > Button.USE_ITEM:
        raise WireError(f"unknown buttons {buttons:#x}", Reason.OUT_OF_RANGE)
    if source > max(Source):
        raise WireError(f"unknown source {source}", Reason.OUT_OF_RANGE)
    pose = Pose(*(row[0], *values, Source(source), row[1]))
    return PoseFrame(row[2], row[3], row[4], pose, Button(buttons))
