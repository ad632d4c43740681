"""Fans of rays: lidar and radar of one kart, against walls, karts and hazards."""

import math

from race_server.core import codes
from race_server.core.kernels.geometry import cos_sin, ray_to_box
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rays import cast_ray
from race_server.core.kernels.rng import bits, normal_of, uniform
from race_server.core.kernels.wall_scan import FEW_RAYS, scan_walls
from race_server.core.state import Bytes, Float32s, Floats, Record, Walls

# More rays than any sensor has: keeps the counters of two karts apart.
RAYS_LIMIT = 4096


@kernel
def cast_fan(
    walls: Walls,
    site: Record,
    x: float,
    y: float,
    cos: float,
    sin: float,
    rays: Floats,
    field: float,
    reach: float,
    ranges: Float32s,
    kinds: Bytes,
) -> None:
    """Fill the ranges [m] and kinds that a fan of rays sees of the walls.

    (x, y) and (cos, sin): place and direction of the sensor; rays: (R, 2) cosine and sine of
    each ray in its frame. `kinds` may be empty where nobody asks.
    """
    if len(rays) > FEW_RAYS and len(kinds) == 0:
        scan_walls(walls, site, x, y, cos, sin, rays, field, reach, ranges)
        return
    for ray in range(len(rays)):
        c = cos * rays[ray, 0] - sin * rays[ray, 1]
        s = sin * rays[ray, 0] + cos * rays[ray, 1]
        distance, wall = cast_ray(walls, site, x, y, c, s, reach)
        ranges[ray] = distance
        if len(kinds) > 0:
            kinds[ray] = walls.kinds[wall] if wall >= 0 else codes.NOTHING


@kernel
def see_body(
    x: float,
    y: float,
    cos: float,
    sin: float,
    rays: Floats,
    reach: float,
    body_x: float,
    body_y: float,
    heading: float,
    offset: float,
    half_length: float,
    half_width: float,
    kind: int,
    ranges: Float32s,
    kinds: Bytes,
) -> None:
    """Shorten the rays of a fan that the body of a kart stands in.

    The body is an oriented box, `offset` [m] ahead of (body_x, body_y) along `heading` [rad].
    """
    dx, dy = body_x - x, body_y - y
    radius = abs(offset) + math.sqrt(half_length * half_length + half_width * half_width)
    near = reach + radius
    along, across = dx * cos + dy * sin, dy * cos - dx * sin
    if dx * dx + dy * dy > near * near or (along < -radius and rays[0, 0] >= 0.0):
        return  # out of reach, or behind a fan of half a turn or less
    box_cos, box_sin = 0.0, 0.0  # worked out for the first ray that may meet the box
    for ray in range(len(rays)):
        rc, rs = rays[ray, 0], rays[ray, 1]
        # First the circle around the box: beside the ray, behind it, or beyond what stops it?
        ahead, aside = along * rc + across * rs, across * rc - along * rs
        if aside * aside > radius * radius or ahead < -radius or ranges[ray] <= ahead - radius:
            continue
        if box_cos == 0.0 and box_sin == 0.0:
            box_cos, box_sin = cos_sin(heading)
        # The sensor and its ray in the frame of the box.
        u, v = -(dx * box_cos + dy * box_sin) - offset, dx * box_sin - dy * box_cos
        c, s = cos * box_cos + sin * box_sin, sin * box_cos - cos * box_sin
        distance = ray_to_box(u, v, c * rc - s * rs, s * rc + c * rs, half_length, half_width)
        if distance < ranges[ray]:
            ranges[ray] = distance
            if len(kinds) > 0:
                kinds[ray] = kind


@kernel
def see_disc(
    x: float,
    y: float,
    cos: float,
    sin: float,
    rays: Floats,
    reach: float,
    disc_x: float,
    disc_y: float,
    radius: float,
    kind: int,
    ranges: Float32s,
    kinds: Bytes,
) -> None:
    """Shorten the rays of a fan that a disc lies in. From inside a disc is not seen."""
    dx, dy = disc_x - x, disc_y - y
    square = dx * dx + dy * dy
    near = reach + radius
    if square > near * near or square <= radius * radius:
        return
    along, across = dx * cos + dy * sin, dy * cos - dx * sin
    for ray in range(len(rays)):
        ahead = along * rays[ray, 0] + across * rays[ray, 1]
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
    kart: int,
) -> None:
    """Add noise of deviation `noise` [m] to ranges; a share `dropout` of them becomes 0."""
    if noise <= 0.0 and dropout <= 0.0:
        return
    for ray in range(len(ranges)):
        counter = kart * RAYS_LIMIT + ray
        if dropout > 0.0 and uniform(seed, stream, tick, -1 - counter) < dropout:
            ranges[ray] = 0.0
        elif noise > 0.0:
            value = ranges[ray] + noise * normal_of(bits(seed, stream, tick, counter))
            ranges[ray] = min(max(value, 0.0), reach)
