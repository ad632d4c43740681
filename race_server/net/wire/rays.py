"""What the sensors of a kart would see, for who draws it: written and read."""

import struct
from dataclasses import dataclass

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.errors import WireError
from race_server.net.wire.generated.spectate import Rays
from race_server.net.wire.strict import U16, U32, root_of

RAYS_ID = b"RRAY"
F32 = struct.Struct("<f")
MOST_RAYS = 2048
MOST_BYTES = 1 << 15

Float32s = NDArray[np.float32]
_NUMBERS = ("X", "Y", "Heading", "LidarAhead", "LidarField", "LidarReach")


@dataclass(frozen=True)
class RaysFrame:
    """The rays of one kart at one tick, as if there were no noise."""

    tick: int
    seat: int
    x: float  # [m] centre of gravity
    y: float
    heading: float
    lidar_ahead: float  # [m] of the centre of gravity
    lidar_field: float  # [rad] between the outermost rays
    lidar_reach: float  # [m]
    lidar: Float32s  # (R,) [m] from right to left
    radar_ahead: float  # [m]
    radar_reach: float  # [m]
    radar_angles: Float32s  # (9,) [rad] left positive
    radar: Float32s  # (9,) [m]
    radar_kinds: NDArray[np.uint8]  # (9,) what each hits, see `race_server.core.codes`


def encode_rays(frame: RaysFrame) -> bytes:
    """Return rays as a message."""
    builder = flatbuffers.Builder(256 + 4 * len(frame.lidar))
    lidar, angles, radar = (
        builder.CreateNumpyVector(np.ascontiguousarray(values, "<f4"))
        for values in (frame.lidar, frame.radar_angles, frame.radar)
    )
    kinds = builder.CreateNumpyVector(np.ascontiguousarray(frame.radar_kinds, "u1"))
    place = (frame.x, frame.y, frame.heading)
    numbers = (*place, frame.lidar_ahead, frame.lidar_field, frame.lidar_reach)
    Rays.Start(builder)
    Rays.AddTick(builder, frame.tick)
    Rays.AddSeat(builder, frame.seat)
    for name, value in zip(_NUMBERS, numbers, strict=True):
        getattr(Rays, f"Add{name}")(builder, value)
    Rays.AddLidar(builder, lidar)
    Rays.AddRadarAhead(builder, frame.radar_ahead)
    Rays.AddRadarReach(builder, frame.radar_reach)
    Rays.AddRadarAngles(builder, angles)
    Rays.AddRadar(builder, radar)
    Rays.AddRadarKinds(builder, kinds)
    builder.Finish(Rays.End(builder), RAYS_ID)
    return bytes(builder.Output())


def decode_rays(data: bytes) -> RaysFrame:
    """Return the rays in a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, RAYS_ID, MOST_BYTES)
    x, y, heading, ahead, field, reach = (table.number(slot, F32) for slot in range(2, 8))
    vectors = []
    for slot in (8, 11, 12):
        first, count = table.vector(slot, F32.size, MOST_RAYS)
        vectors.append(np.frombuffer(data, "<f4", count, first))
    lidar, angles, radar = vectors
    first, count = table.vector(13, 1, MOST_RAYS)
    kinds = np.frombuffer(data, np.uint8, count, first)
    if not len(angles) == len(radar) == len(kinds):
        raise WireError("radar of more angles than ranges, or the other way round")
    return RaysFrame(
        tick=table.scalar(0, U32),
        seat=table.scalar(1, U16),
        x=x,
        y=y,
        heading=heading,
        lidar_ahead=ahead,
        lidar_field=field,
        lidar_reach=reach,
        lidar=lidar,
        radar_ahead=table.number(9, F32),
        radar_reach=table.number(10, F32),
        radar_angles=angles,
        radar=radar,
        radar_kinds=kinds,
    )
