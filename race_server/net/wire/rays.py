"""Encode what the sensors of a kart would see, for the page."""

from dataclasses import dataclass

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.net.wire.generated.spectate import Rays

RAYS_ID = b"RRAY"

Float32s = NDArray[np.float32]
_NUMBERS = ("X", "Y", "Heading", "LidarAhead", "LidarField", "LidarReach")


@dataclass(frozen=True)
class RaysFrame:
    """The rays of one kart at one tick, without noise."""

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
    radar_kinds: NDArray[np.uint8]  # (9,) RayHit


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
