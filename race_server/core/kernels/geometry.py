"""Angles, poses, arcs, boxes and segments."""

import math
from typing import NamedTuple

from race_server.core.kernels.jit import kernel

TURN = 2.0 * math.pi
# A quarter turn [rad] in two parts: few enough bits that small multiples of the first are exact,
# and what is missing.
QUARTER_HIGH, QUARTER_LOW = 1.57079632673412561417e00, 6.07710050650619224932e-11
# `rough_angle` is off by less than this [rad].
ROUGHNESS = 0.004


class Pose(NamedTuple):
    """A place and a direction in the plane."""

    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad]


@kernel
def wrap_angle(angle: float) -> float:
    """Return `angle` [rad] moved by whole turns into [-pi, pi)."""
    if -math.pi <= angle < math.pi:
        return angle
    return angle - TURN * math.floor((angle + math.pi) / TURN)


@kernel
def clip(value: float, low: float, high: float) -> float:
    """Return `value`, but not outside [low, high]."""
    return low if value < low else (high if value > high else value)  # noqa: RUF100 FURB136


@kernel
def sign(value: float) -> float:
    """Return -1, 0 or 1."""
    return 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)


@kernel
def cos_sin(angle: float) -> tuple[float, float]:
    """Return cosine and sine of an angle [rad] of at most a few turns, to within 2e-16.

    Both cost less than one call of the machine's own mathematics library, and they are the same on
    every machine. Polynomials of degree 13 and 14 between -pi/4 and pi/4 with the coefficients of
    FDLIBM (Sun Microsystems, 1993), after taking away quarter turns.
    """
    quarters = math.floor(angle * (2.0 / math.pi) + 0.5)
    rest = (angle - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW
    z = rest * rest
    odd = -1.98412698298579493134e-04 + z * (
        2.75573137070700676789e-06
        + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    )
    odd = -1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * odd)
    sin = rest + rest * z * odd
    even = 2.48015872894767294178e-05 + z * (
        -2.75573143513906633035e-07
        + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    )
    even = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * even)
    cos = 1.0 - 0.5 * z + z * z * even
    if quarters & 1:
        cos, sin = -sin, cos
    return (-cos, -sin) if quarters & 2 else (cos, sin)


@kernel
def along_arc(pose: Pose, curvature: float, way: float) -> Pose:
    """Return the pose after a way [m] on an arc, negative in reverse; the heading is not wrapped.

    curvature: [1/m], positive to the left. The chord of an arc that turns by a lies half a turn
    off, and is sin(a/2) / (a/2) times as long as the arc.
    """
    half = 0.5 * curvature * way
    if half != 0.0:
        _, sin = cos_sin(half)
        chord = way * sin / half
    else:
        chord = way
    cos, sin = cos_sin(pose.heading + half)
    return Pose(pose.x + chord * cos, pose.y + chord * sin, pose.heading + 2.0 * half)


@kernel
def seen_from(pose: Pose, other: Pose) -> Pose:
    """Return another pose in the frame of a pose, its heading in [-pi, pi)."""
    cos, sin = cos_sin(pose.heading)
    dx, dy = other.x - pose.x, other.y - pose.y
    heading = wrap_angle(other.heading - pose.heading)
    return Pose(dx * cos + dy * sin, dy * cos - dx * sin, heading)


@kernel
def rough_angle(x: float, y: float) -> float:
    """Return the direction of (x, y) [rad] in (-pi, pi], to within `ROUGHNESS`.

    arctan z is about z (pi/4 + 0.273 (1 - |z|)) for |z| up to 1 (Rajan et al. 2006).
    """
    ax, ay = abs(x), abs(y)
    if ax >= ay:
        ratio = ay / ax if ax > 0.0 else 0.0
        angle = ratio * (0.25 * math.pi + 0.273 * (1.0 - ratio))
    else:
        ratio = ax / ay
        angle = 0.5 * math.pi - ratio * (0.25 * math.pi + 0.273 * (1.0 - ratio))
    if x < 0.0:
        angle = math.pi - angle
    return angle if y >= 0.0 else -angle


@kernel
def ray_to_box(
    x: float, y: float, cos: float, sin: float, half_length: float, half_width: float
) -> float:
    """Return how far along a ray a box centred on the origin lies, or infinity.

    x, y: start of the ray in the frame of the box [m]; cos, sin: of its direction there;
    half_length, half_width: of the box [m]. From inside the distance is 0.
    """
    near, far = 0.0, math.inf
    if cos == 0.0:
        if abs(x) > half_length:
            return math.inf
    else:
        a, b = (-half_length - x) / cos, (half_length - x) / cos
        near, far = max(near, min(a, b)), min(far, max(a, b))
    if sin == 0.0:
        if abs(y) > half_width:
            return math.inf
    else:
        a, b = (-half_width - y) / sin, (half_width - y) / sin
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near if near <= far else math.inf


@kernel
def distance_to_box(
    x: float, y: float, cos: float, sin: float, half_length: float, half_width: float
) -> float:
    """Return the distance [m] from a point to a box, 0 inside of it.

    x, y: of the point from the middle of the box [m]; cos, sin: of the heading of the box;
    half_length, half_width: of the box [m].
    """
    along = max(abs(x * cos + y * sin) - half_length, 0.0)
    across = max(abs(y * cos - x * sin) - half_width, 0.0)
    return math.sqrt(along * along + across * across)
