"""How far beside a lane a kart drives so that its whole body keeps clear of the borders.

The lap of minimum time is that of a point with room on both sides. A body points into its bend by
the slip of its rear tyres, so that the corners of its nose and its tail come nearer to the borders
than its middle says; and what it does wrong grows with its speed.
"""

from race_agents.planning.tactics import SPEED
from race_agents.planning.traffic import LEFT, RIGHT, STEP
from race_agents.planning.tyre_slip import grip_of, slide_of, slip_share, tyre_slip
from race_server.core.kernel_driver import Cockpit
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import AHEAD, PART_NUMBERS
from race_server.core.state import Record

CURVATURE = PART_NUMBERS["line_curvature_ahead"]
LINE_SPEED = PART_NUMBERS["line_speed_ahead"]

# Free room [body widths] between a body and the border, and as much more as it goes aside within
# DOUBT_S seconds at an error of the heading of DOUBT radians.
FREE_WIDTHS, DOUBT, DOUBT_S = 0.16, 0.1, 0.05
# The place that counts lies so far ahead [s], and as many steps of the line around it; both at
# least this many steps. A border that is nearest one step before or behind counts there, too.
AHEAD_S, AROUND_S = 0.15, 0.25
AHEAD_STEPS, AROUND_STEPS = 1.5, 3.0
# Never more than this [body widths].
MOST_WIDTHS = 0.4


@large_kernel
def keep_clear(cockpit: Cockpit, lane: float) -> float:
    """Return how far [m] to the left of a lane to drive, so that the body keeps clear.

    lane: [m] left of the line.
    """
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    speed, step = max(observation[offsets[SPEED]], 1.0), max(observation[offsets[STEP]], 0.01)
    place = max(AHEAD_S * speed / step, AHEAD_STEPS)
    around = max(AROUND_S * speed / step, AROUND_STEPS)
    last = min(int(place + around) + 2, AHEAD)
    moved = weights = 0.0
    before = here = 0.0
    for index in range(last):
        after = lacking(cockpit, lane, index)
        # One sample late: what is wanted on both sides of it is known now.
        if index > 0:
            wanted = max(before, here, after, 0.0) + min(before, here, after, 0.0)
            weight = max(1.0 - abs(index - 1.0 - place) / around, 0.0)
            moved += weight * wanted
            weights += weight
        before, here = here, after
    most = MOST_WIDTHS * vehicle.width
    return min(max(moved / max(weights, 1e-6), -most), most)


@large_kernel
def lacking(cockpit: Cockpit, lane: float, index: int) -> float:
    """Return the room [m] that lacks beside a sample of the line, positive where it does right."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    speed, bend = observation[offsets[LINE_SPEED] + index], observation[offsets[CURVATURE] + index]
    grip = grip_of(cockpit)
    used = min(speed * speed * abs(bend) / grip, 1.0)
    slide = slide_of(vehicle, grip)
    slip = slip_share(cockpit.memory) * tyre_slip(used, slide)
    inward = slip - vehicle.rear_axle * abs(bend)  # where the nose points, beside the way
    inner, outer = reach_aside(vehicle, inward)
    free = FREE_WIDTHS * vehicle.width + DOUBT * DOUBT_S * speed
    left, right = (inner, outer) if bend >= 0.0 else (outer, inner)
    left = max(left + free - (observation[offsets[LEFT] + index] - lane), 0.0)
    right = max(right + free - (observation[offsets[RIGHT] + index] + lane), 0.0)
    if left > 0.0 and right > 0.0:
        return 0.5 * (right - left)
    return right - left


@kernel
def reach_aside(vehicle: Record, turned: float) -> tuple[float, float]:
    """Return how far [m] a body reaches beside its way, to the side that it is turned to first.

    turned: by which angle [rad].
    """
    nose, tail = 0.5 * vehicle.length + vehicle.box_offset, 0.5 * vehicle.length
    half = 0.5 * vehicle.width
    return half + max(nose * turned, -tail * turned), half + max(tail * turned, -nose * turned)
