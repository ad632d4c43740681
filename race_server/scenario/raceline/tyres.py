"""What a bend costs: a tyre pulls sideways only while it slips, and what slips brakes.

Fiala's brush tyre (Pacejka, Tire and Vehicle Dynamics, 3.2), as in `core/kernels/motion.py`: with
the lateral stiffness C, the most lateral force F_limit that the force along leaves, and the slip
tan(a) over that at which the whole contact patch slides, s = C tan(a) / (3 F_limit),

    F = F_limit (1 - (1 - s)³)    and so    s = 1 - (1 - F / F_limit)^(1/3).

A wheel that moves at the angle a to its own plane is held back by F sin(a), here F tan(a): at the
limit 0.94 instead of 0.95 m/s² for the 1/10 car. Both axles carry their share w of the lateral
force, so that the vehicle's acceleration a_y costs a_y (w_front tan(a_front) + w_rear tan(a_rear)).

The front wheels pull across themselves, and they are turned by d: of their force only cos(d) acts
across the vehicle. In its tightest bends a car therefore has less grip, and as its front wheels
slip more than the rear ones it needs more steering than the wheels' directions alone would:
d = atan(wheelbase · curvature) + a_front - a_rear. With d of the first term alone in cos(d).
With ideal tyres (`slide` is 0) a bend costs none of this.
"""

import math
from typing import Any, NamedTuple

from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.program import Program

# Smooths |s| where the side changes, [-].
_SMOOTH = 1e-3
# Left of the grip's square where all of it is used along: a root must keep a slope.
_REMNANT = 1e-4


class Axle(NamedTuple):
    """Shares of one axle."""

    load: float  # of the weight, and so of the lateral force
    drive: float  # of the driving force
    brake: float  # of the braking force


def axles_of(bounds: Bounds) -> tuple[Axle, Axle]:
    """Return the front and the rear axle."""
    front = Axle(bounds.front_load, bounds.front_drive, bounds.front_brake)
    return front, Axle(*(1.0 - share for share in front))


def front_effort(curvature: float, bounds: Bounds) -> float:
    """Return the front tyres' force over what of it acts across the vehicle in a bend [1/m]."""
    return math.hypot(1.0, bounds.wheelbase * curvature) if bounds.slide > 0.0 else 1.0


def cornering_drag(speed: float, curvature: float, force: float, bounds: Bounds) -> float:
    """Return the deceleration [m/s²] by slip at a speed [m/s] in a bend [1/m].

    force: [m/s²] of the motor, or less than zero of the brakes, over the mass.
    """
    drag, lateral = 0.0, speed * speed * abs(curvature)
    sides = (lateral * front_effort(curvature, bounds), lateral)
    for axle, side in zip(axles_of(bounds), sides, strict=True):
        share = axle.drive if force > 0.0 else axle.brake
        along = force * share / (axle.load * bounds.lateral)
        left = math.sqrt(max(1.0 - along * along, _REMNANT))
        used = min(side / (bounds.lateral * left), 1.0)
        drag += axle.load * side * left * (1.0 - (1.0 - used) ** (1.0 / 3.0))
    return bounds.slide * drag


def slip_of(
    program: Program, pace: Any, curvature: Any, drive: Any, brake: Any, bounds: Bounds
) -> Any:
    """Require that the tyres hold and the steering suffice; return the deceleration (N,) by slip.

    pace: (N,) [m/s]; curvature: (N,) [1/m]; drive, brake: (N,) [m/s²]. The slip s of each axle is
    an unknown of the program: its force is a cubic that a solver likes, the inverse has an infinite
    slope where the tyre slides.
    """
    ca, drag, steering = program.casadi, 0.0, bounds.wheelbase * curvature
    lateral = pace**2 * curvature
    effort = ca.sqrt(1.0 + steering**2) if bounds.slide > 0.0 else 1.0
    front, rear = axles_of(bounds)
    for axle, side, way in ((front, lateral * effort, 1.0), (rear, lateral, -1.0)):
        share = program.unknown(-1.0, 1.0, 0.0)
        along = (drive * axle.drive + brake * axle.brake) / (axle.load * bounds.lateral)
        program.keep_negative(along**2 - 1.0)
        left = ca.sqrt(1.0 + _REMNANT - along**2)
        size = ca.sqrt(share**2 + _SMOOTH**2)
        cubic = 3.0 * share * (1.0 - size) + share**3
        program.keep_zero(side / bounds.lateral - left * cubic)
        slip = bounds.slide * left * share
        drag += axle.load * side * slip
        steering += way * slip
    most = bounds.wheelbase * bounds.curvature
    program.keep_negative(steering - most)
    program.keep_negative(-steering - most)
    return drag
