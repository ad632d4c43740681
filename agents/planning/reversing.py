"""Controllers that reverse a trailer: one holds an angle at the hitch, one keeps to a line.

Reversing is unstable: an angle that is left alone grows by e on each length of the bar. The first
controller takes the model's own terms away, so that what is left of the angle's error decays
exactly: with the way s of the rear axle, forward or back, and the wanted angle w,

    db/d|s| = gain (w - b).

To its trailer a vehicle that reverses is a car of the bar's length, steered by -b. The second
controller asks for the angle that turns this car towards the line, the more the farther it is off.
"""

import math

from race_server.core.free_space.rig import Rig, curvature_of_rate, scale_of
from race_server.core.kernels.geometry import clip
from race_server.core.kernels.jit import kernel

# Of the angle's error [1/m], of the direction and of the offset of the trailer [1/m], all for the
# usual bar.
ANGLE_GAIN, TURN_GAIN, OFFSET_GAIN = 1.0, 0.35, 0.15
# The trailer crosses the way back to the line at most so steeply [rad].
STEEPEST = 0.6


@kernel
def curvature_towards(rig: Rig, angle: float, wanted: float, planned: float, way: float) -> float:
    """Return the curvature [1/m] on which the angle at the hitch goes to the wanted one [rad].

    planned: by how much that one itself changes on a metre driven [rad/m], 0 if it is held; way:
    the direction of travel, negative in reverse. Not clipped.
    """
    gain = ANGLE_GAIN / scale_of(rig.bar)
    rate = planned + gain * (wanted - angle)
    return curvature_of_rate(rig, angle, rate if way > 0.0 else -rate)


@kernel
def angle_towards(rig: Rig, offset: float, turn: float, planned: float, way: float) -> float:
    """Return the angle at the hitch [rad] with which a trailer comes back to its way.

    offset: of the trailer's axle to the left of the way [m]; turn: of the trailer against
    it [rad]; planned: the angle on the way [rad], 0 on a line; way: the direction of travel.
    """
    scale = scale_of(rig.bar)
    slant = clip(OFFSET_GAIN / scale * offset, -STEEPEST, STEEPEST)
    error = turn - slant if way < 0.0 else -turn - slant
    tangent = math.tan(planned) + rig.bar * TURN_GAIN / scale * error
    # A way may lead through a sharper angle than the controller itself asks for.
    low, high = min(-rig.sharpest, planned), max(rig.sharpest, planned)
    return clip(math.atan(tangent), low, high)
