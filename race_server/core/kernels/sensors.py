"""Fans of rays: lidar and radar of one kart, against walls, karts and hazards."""

import math

from race_server.core import codes
from race_server.core.kernels.boxes import Hull
from race_server.core.kernels.geometry import cos_sin, ray_to_box
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rays import Fan, cast_ray
from race_server.core.kernels.rng import bits, normal_of, uniform
from race_server.core.kernels.wall_scan import FEW_RAYS, scan_walls
from race_server.core.state import Bytes, Float32s, Record, Walls

# More rays than any sensor has: keeps the counters of two karts apart.
RAYS_LIMIT = 4096


@kernel
def cast_fan(walls: Walls, site: Record, fan: Fan, ranges: Float32s, kinds: Bytes) -> None:
    """Fill the ranges [m] and kinds that a fan of rays sees of the walls.

    site: SITE; ranges: (R,); kinds: (R,) Hit, or empty where only ranges are wanted.
    """
    if len(fan.rays) > FEW_RAYS and len(kinds) == 0:
        scan_walls(walls, site, fan, ranges)
        return
    for ray in range(len(fan.rays)):
        c = fan.cos * fan.rays[ray, 0] - fan.sin * fan.rays[ray, 1]
        s = fan.sin * fan.rays[ray, 0] + fan.cos * fan.rays[ray, 1]
        distance, wall = cast_ray(walls, site, fan.x, fan.y, c, s, fan.reach)
        ranges[ray] = distance
        if len(kinds) > 0:
            kinds[ray] = walls.kinds[wall] if wall >= 0 else codes.NOTHING


@kernel
def see_body(fan: Fan, body: Hull, kind: int, ranges: Float32s, kinds: Bytes) -> None:
    """Shorten the rays of a fan that meet the body of a kart.

    ranges: (R,) [m], already filled; kind: Hit that is written to `kinds` (R,) unless it is empty.
    """
    dx, dy = body.x - fan.x, body.y - fan.y
    half_length, half_width = body.half_length, body.half_width
    radius = abs(body.offset) + math.sqrt(half_length * half_length + half_width * half_width)
    near = fan.reach + radius
    along, across = dx * fan.cos + dy * fan.sin, dy * fan.cos - dx * fan.sin
    if dx * dx + dy * dy > near * near or (along < -radius and fan.rays[0, 0] >= 0.0):
        return  # out of reach, or behind a fan of half a turn or less
    box_cos, box_sin = 0.0, 0.0  # computed for the first ray that may meet the box
    for ray in range(len(fan.rays)):
        rc, rs = fan.rays[ray, 0], fan.rays[ray, 1]
        # First the circle around the box: beside the ray, behind it, or beyond what stops it?
        ahead, aside = along * rc + across * rs, across * rc - along * rs
        if aside * aside > radius * radius or ahead < -radius or ranges[ray] <= ahead - radius:
            continue
        if box_cos == 0.0 and box_sin == 0.0:
            box_cos, box_sin = cos_sin(body.heading)
        # The sensor and its ray in the frame of the box.
        u, v = -(dx * box_cos + dy * box_sin) - body.offset, dx * box_sin - dy * box_cos
        c, s = fan.cos * box_cos + fan.sin * box_sin, fan.sin * box_cos - fan.cos * box_sin
        distance = ray_to_box(u, v, c * rc - s * rs, s * rc + c * rs, half_length, half_width)
        if distance < ranges[ray]:
            ranges[ray] = distance
            if len(kinds) > 0:
                kinds[ray] = kind


@kernel
def see_disc(
    fan: Fan, x: float, y: float, radius: float, kind: int, ranges: Float32s, kinds: Bytes
) -> None:
    """Shorten the rays of a fan that meet a disc. From inside a disc is not seen.

    x, y, radius: of the disc [m]; ranges: (R,) [m], already filled; kind: Hit that is written to
    `kinds` (R,) unless it is empty.
    """
    dx, dy = x - fan.x, y - fan.y
    square = dx * dx + dy * dy
    near = fan.reach + radius
    if square > near * near or square <= radius * radius:
        return
    along, across = dx * fan.cos + dy * fan.sin, dy * fan.cos - dx * fan.sin
    for ray in range(len(fan.rays)):
        ahead = along * fan.rays[ray, 0] + across * fan.rays[ray, 1]
        root = radius * radius - (square - ahead * ahead)
        if ahead > 0.0 and root >= 0.0:
            distance = ahead - math.sqrt(root)
            if distance < ranges[ray]:
                ranges[ray] = distance
                if len(kinds) > 0:
                    kinds[ray] = kind


@kernel
def disturb(
    ranges: Float32s,
    reach: float,
    noise: float,
    dropout: float,
    seed: int,
    stream: int,
    tick: int,
    place: int,
) -> None:
    """Add noise of deviation `noise` [m] to ranges (R,); a share `dropout` of them becomes 0.

    reach: largest range [m]; seed, stream, tick, and the kart's place on the grid: of the random
    numbers, see `rng`. By its place a kart alone on pole measures the same, whatever its seat.
    """
    if noise <= 0.0 and dropout <= 0.0:
        return
    for ray in range(len(ranges)):
        counter = place * RAYS_LIMIT + ray
        if dropout > 0.0 and uniform(seed, stream, tick, -1 - counter) < dropout:
            ranges[ray] = 0.0
        elif noise > 0.0:
            value = ranges[ray] + noise * normal_of(bits(seed, stream, tick, counter))
            ranges[ray] = min(max(value, 0.0), reach)
