"""The lap of minimum time as an optimal control problem in track coordinates."""

from dataclasses import dataclass

import numpy as np

from race_server.scenario.raceline.baselines import CALM, STEEPEST, OffsetLine, follow_track
from race_server.scenario.raceline.bounds import SLOWEST, Bounds
from race_server.scenario.raceline.frame import Frame
from race_server.scenario.raceline.program import EXACT, Program, following
from race_server.scenario.raceline.turning_over import swiftness
from race_server.scenario.raceline.tyres import slip_of
from race_server.scenario.track.course import Floats

# Weight of the squared difference of the curvature's rate between stations: the trapezoidal rule
# hardly sees a rate that alternates. It costs less than 0.1 % of a lap.
CALMER = 1e-5


@dataclass(frozen=True)
class TimedLine:
    """A line and the speeds along it, at the N stations of a frame."""

    line: OffsetLine
    speed: Floats  # (N,) [m/s]
    time_s: float


def fastest_lap(
    frame: Frame,
    bounds: Bounds,
    start: OffsetLine,
    speed: Floats,
    *,
    tolerance: float = EXACT,
    follows: bool = False,
) -> TimedLine:
    """Return the flying lap of minimum time, starting from another line and its speeds.

    States along the centre line's s: offset n, bearing b, speed v, curvature c; controls: the
    accelerations of motor and brakes, and the rate u of the curvature. With k the curvature of the
    centre line and stretch = (1 - n k) / cos b:
    dt/ds = stretch / v; v' = stretch a / v; c' = stretch u / v; n' and b' as for any line.
    Within: the friction of each axle, motor force and power, brakes, steering angle and rate,
    width. From a come off rolling resistance, air drag and the drag of the tyres' slip.
    Formulation: Perantoni and Limebeer, Optimal control for a Formula One car, 2014, with the
    vehicle as a point mass; trapezoidal collocation; all states close with the lap.

    follows: turn from one side to the other no faster than a body with a yaw inertia can follow.
    """
    program = Program(len(frame.x), frame.step)
    slope = np.roll(speed, -1) ** 2 - speed**2
    guess = 0.5 * slope / (frame.step * start.stretch(frame))
    offset = program.unknown(frame.low, frame.high, start.offset)
    bearing = program.unknown(-STEEPEST, STEEPEST, start.bearing)
    curvature = program.unknown(-bounds.curvature, bounds.curvature, start.curvature)
    pace = program.unknown(SLOWEST, bounds.top_speed, speed)
    drive = program.unknown(0.0, bounds.drive, guess)
    brake = program.unknown(0.0, bounds.brake, -guess)
    turning = program.unknown(-np.inf, np.inf, 0.0)

    stretch = follow_track(program, frame, offset, bearing, curvature)
    slowness = stretch / pace
    slipping = slip_of(program, pace, curvature, drive, brake, bounds)
    losses = bounds.rolling + bounds.drag * pace**2 + slipping
    program.evolve(pace, slowness * (drive - brake - losses))
    program.evolve(curvature, slowness * turning)
    program.keep_negative(drive * pace / bounds.power - 1.0)
    # tan(steering) = wheelbase · curvature, so that a steering rate turns the curvature faster
    # the further the wheels are turned.
    turn = 1.0 + (bounds.wheelbase * curvature) ** 2
    fastest = bounds.steering_rate / bounds.wheelbase * turn
    program.keep_negative(turning - fastest)
    program.keep_negative(-turning - fastest)

    for share in swiftness(turning, pace, speed, bounds) if follows else ():
        program.keep_negative(share - 1.0)
        program.keep_negative(-share - 1.0)

    swing = following(turning) - turning
    total = frame.step * program.casadi.sum1(slowness + CALM * turning**2 + CALMER * swing**2)
    found = program.minimise(total, f"{frame.name}: lap of minimum time", tolerance)
    line = OffsetLine(*found[:3])
    time = float(np.sum(frame.step * line.stretch(frame) / found[3]))
    return TimedLine(line, found[3], time)
