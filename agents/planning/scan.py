"""A lidar scan made fit for driving. Scans lie inside longer arrays, from `start` or `base` on."""

import math

from race_server.core.kernel_driver import KEPT, SCAN_AGE, SCAN_SUM
from race_server.core.kernels.jit import kernel
from race_server.core.state import Floats

# Rays to each side that tell of the same place of a wall, and the least range [m].
BESIDE, NEAREST = 2, 0.05


@kernel
def ray_angle(ray: float, rays: int, field: float) -> float:
    """Return the angle [rad] of a ray, left positive; the first ray is the rightmost."""
    return field * (ray / (rays - 1) - 0.5)


@kernel
def fill_dropouts(
    observation: Floats, start: int, rays: int, reach: float, out: Floats, base: int
) -> None:
    """Copy a scan; drop-outs (zeros) take the value between their neighbours.

    observation: (size,), the scan of `rays` ranges [m] from `start` on; out: (n,), written from
    `base` on. A scan without any echo counts as free up to `reach` [m].
    """
    last = -1
    for ray in range(rays):
        value = observation[start + ray]
        if value <= 0.0:
            continue
        out[base + ray] = value
        for lost in range(last + 1, ray):
            if last < 0:
                out[base + lost] = value
            else:
                before = out[base + last]
                out[base + lost] = before + (value - before) * (lost - last) / (ray - last)
        last = ray
    for lost in range(last + 1, rays):
        out[base + lost] = out[base + last] if last >= 0 else reach


@kernel
def smooth_walls(ranges: Floats, base: int, rays: int, jump: float) -> None:
    """Replace each range by what its neighbours on the same wall tell of it.

    Seen from anywhere, 1 / range along a straight wall is a cosine of the angle, which a mean over
    a few rays to both sides leaves as it is. ranges: (n,) [m], the scan of `rays` ranges from
    `base` on; as many numbers behind it are overwritten; jump: difference of two neighbours [m]
    that belongs to two walls.
    """
    kept = base + rays
    for ray in range(rays):
        ranges[kept + ray] = ranges[base + ray]
    for ray in range(rays):
        total, aside = 1.0 / max(ranges[kept + ray], NEAREST), 1
        while aside <= BESIDE and ray >= aside and ray + aside < rays:
            right, left = kept + ray - aside, kept + ray + aside
            rise, fall = ranges[left] - ranges[left - 1], ranges[right + 1] - ranges[right]
            if max(abs(rise), abs(fall)) > jump:
                break
            total += 1.0 / max(ranges[right], NEAREST) + 1.0 / max(ranges[left], NEAREST)
            aside += 1
        ranges[base + ray] = (2 * aside - 1) / total


@kernel
def widen_edges(
    ranges: Floats,
    base: int,
    rays: int,
    step: float,
    half_width: float,
    jump: float,
    out: Floats,
    wide: int,
) -> None:
    """Copy a scan from `base` to `wide`; every near edge hides what lies close beside it.

    Behind an edge the space is only free for a body of half-width `half_width` [m] if it passes
    that edge at this distance. Disparity extender: Otterness, 2019. ranges, out: (n,) [m], the scan
    of `rays` ranges; step: angle between two rays [rad]; jump: difference of two neighbouring
    ranges [m] that counts as an edge.
    """
    for ray in range(rays):
        out[wide + ray] = ranges[base + ray]
    for edge in range(rays - 1):
        rise = ranges[base + edge + 1] - ranges[base + edge]
        if abs(rise) <= jump:
            continue
        near = edge if rise > 0.0 else edge + 1
        distance = max(ranges[base + near], half_width)
        count = int(math.asin(min(half_width / distance, 1.0)) / step) + 1
        first, last = (near, near + count) if rise > 0.0 else (near - count, near)
        for ray in range(max(first, 0), min(last, rays - 1) + 1):
            out[wide + ray] = min(out[wide + ray], ranges[base + near])


@kernel
def nearest(
    ranges: Floats, base: int, rays: int, field: float, low: float, high: float, far: float
) -> float:
    """Return the smallest range [m] between the angles `low` and `high` [rad], at most `far`.

    ranges: (n,) [m], the scan of `rays` ranges from `base` on; field: angle between the outermost
    rays [rad].
    """
    best = far
    for ray in range(rays):
        if low < ray_angle(ray, rays, field) < high:
            best = min(best, ranges[base + ray])
    return best


@kernel
def age_of_scan(
    observation: Floats, start: int, rays: int, decision_s: float, memory: Floats
) -> float:
    """Return the time [s] since the scan changed, at most 0.1 s.

    observation: (size,), the scan of `rays` ranges [m] from `start` on; decision_s: time between
    decisions [s]; memory: (M,) of the driver.
    """
    total = 0.0
    for ray in range(rays):
        total += observation[start + ray]
    memory[SCAN_AGE] = min(memory[SCAN_AGE] + decision_s, 0.1) if total == memory[SCAN_SUM] else 0.0
    memory[SCAN_SUM] = total
    return memory[SCAN_AGE]


@kernel
def move_scan(memory: Floats, rays: int, field: float, dx: float, dy: float, turn: float) -> None:
    """Write the kept scan's points as seen from elsewhere: x ahead, then y to the left.

    memory: (M,) of the driver, with `rays` ranges [m]; field: angle between the outermost rays
    [rad]; (dx, dy): where that is [m]; turn: the direction ahead there [rad].
    """
    cos, sin = math.cos(turn), math.sin(turn)
    xs, ys = KEPT + 2 * rays, KEPT + 3 * rays
    for ray in range(rays):
        angle, distance = ray_angle(ray, rays, field), memory[KEPT + ray]
        x, y = distance * math.cos(angle) - dx, distance * math.sin(angle) - dy
        memory[xs + ray] = cos * x + sin * y
        memory[ys + ray] = cos * y - sin * x
