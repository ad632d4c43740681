"""Feelers: rays from the boxes of a vehicle to what is near it, as they are observed.

They have neither noise nor a rate: they are cast when a seat observes. The vehicle's own boxes are
not seen.
"""

import math

from race_server.core import codes
from race_server.core.kernels.boxes import Box, Hull, box_count, box_of, hull_of, reach_of
from race_server.core.kernels.geometry import cos_sin, ray_to_box
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rays import cast_ray
from race_server.core.stages.blocks import block_hull, is_near_block, is_own_block
from race_server.core.state import Float32s, Record, World

REACH = 20.0  # [m]


@large_kernel
def feel(world: World, w: int, k: int, ranges: Float32s) -> None:
    """Fill the ranges of a vehicle's feelers, (FEELERS,), as shares of `REACH`."""
    body, vehicle = world.bodies[w, k], world.vehicles[w, k]
    for ray in range(len(ranges)):
        ranges[ray] = REACH
    for number in range(box_count(vehicle)):
        box = box_of(hull_of(vehicle, body, number))
        _feel_walls(world, w, vehicle, box, ranges)
        _feel_blocks(world, w, k, box, ranges)
        _feel_bodies(world, w, k, box, ranges)
        for walker in world.parking.walkers[w]:
            if walker.radius > 0.0:
                _feel_disc(vehicle, box, walker, ranges)
    for ray in range(len(ranges)):
        ranges[ray] *= 1.0 / REACH


@kernel
def _feel_walls(world: World, w: int, vehicle: Record, box: Box, ranges: Float32s) -> None:
    """Shorten the rays from one box of a vehicle that meet a wall. ranges: (FEELERS,) [m]."""
    site = world.walls.sites[world.rules[w].course]
    for ray in range(vehicle.feeler_count):
        feeler = vehicle.feelers[ray]
        if feeler.box != box.number:
            continue
        x = box.x + feeler.ahead * box.cos - feeler.left * box.sin
        y = box.y + feeler.ahead * box.sin + feeler.left * box.cos
        cos = box.cos * feeler.cos - box.sin * feeler.sin
        sin = box.sin * feeler.cos + box.cos * feeler.sin
        ranges[ray] = cast_ray(world.walls, site, x, y, cos, sin, REACH)[0]


@kernel
def _feel_blocks(world: World, w: int, k: int, box: Box, ranges: Float32s) -> None:
    """Shorten the rays from one box of vehicle k that meet a block. ranges: (FEELERS,) [m]."""
    vehicle, blocks, bodies = world.vehicles[w, k], world.parking.blocks[w], world.bodies.shape[1]
    near = REACH + box.half_length + box.half_width
    for number in range(len(blocks)):
        if is_near_block(blocks[number], box.x, box.y, near):
            if not is_own_block(vehicle, k, bodies, number):
                _feel_box(vehicle, box, block_hull(blocks[number]), ranges)


@kernel
def _feel_bodies(world: World, w: int, k: int, box: Box, ranges: Float32s) -> None:
    """Shorten the rays from one box of vehicle k that meet another one. ranges: (FEELERS,) [m]."""
    for other in range(world.bodies.shape[1]):
        rival, shape = world.bodies[w, other], world.vehicles[w, other]
        if other == k or rival.status != codes.RACING or rival.trust >= codes.SUSPENDED:
            continue
        dx, dy = rival.x - box.x, rival.y - box.y
        near = REACH + box.half_length + box.half_width + reach_of(shape)
        if dx * dx + dy * dy < near * near:
            for number in range(box_count(shape)):
                _feel_box(world.vehicles[w, k], box, hull_of(shape, rival, number), ranges)


@kernel
def _feel_box(vehicle: Record, box: Box, hull: Hull, ranges: Float32s) -> None:
    """Shorten the rays from one box that meet another, a hull. ranges: (FEELERS,) [m]."""
    x, y, half_length, half_width = hull.x, hull.y, hull.half_length, hull.half_width
    other_cos, other_sin = 0.0, 0.0  # computed for the first ray that may meet the hull
    if hull.offset != 0.0:
        other_cos, other_sin = cos_sin(hull.heading)
        x, y = x + hull.offset * other_cos, y + hull.offset * other_sin
    dx, dy = x - box.x, y - box.y
    along, across = dx * box.cos + dy * box.sin, dy * box.cos - dx * box.sin
    radius = math.sqrt(half_length * half_length + half_width * half_width)
    for ray in range(vehicle.feeler_count):
        feeler = vehicle.feelers[ray]
        if feeler.box != box.number:
            continue
        u, v = along - feeler.ahead, across - feeler.left
        # First the circle around the other: beside the ray, behind it, or beyond what stops it?
        aside = v * feeler.cos - u * feeler.sin
        if abs(aside) > radius:
            continue
        ahead = u * feeler.cos + v * feeler.sin
        if ahead < -radius or ranges[ray] <= ahead - radius:
            continue
        if other_cos == 0.0 and other_sin == 0.0:
            other_cos, other_sin = cos_sin(hull.heading)
        # A direction of the one box in the frame of the other.
        cos = box.cos * other_cos + box.sin * other_sin
        sin = box.sin * other_cos - box.cos * other_sin
        c, s = cos * feeler.cos - sin * feeler.sin, sin * feeler.cos + cos * feeler.sin
        x, y = sin * v - cos * u, -sin * u - cos * v
        ranges[ray] = min(ranges[ray], ray_to_box(x, y, c, s, half_length, half_width))


@kernel
def _feel_disc(vehicle: Record, box: Box, walker: Record, ranges: Float32s) -> None:
    """Shorten the rays from one box that meet a person. ranges: (FEELERS,) [m]."""
    dx, dy = walker.x - box.x, walker.y - box.y
    along, across = dx * box.cos + dy * box.sin, dy * box.cos - dx * box.sin
    square = walker.radius * walker.radius
    for ray in range(vehicle.feeler_count):
        feeler = vehicle.feelers[ray]
        u, v = along - feeler.ahead, across - feeler.left
        ahead, aside = u * feeler.cos + v * feeler.sin, v * feeler.cos - u * feeler.sin
        root = square - aside * aside
        if feeler.box == box.number and ahead > 0.0 and root >= 0.0:
            ranges[ray] = min(ranges[ray], max(ahead - math.sqrt(root), 0.0))
