"""The safety reflex of a real kart: pure functions of what the kart itself senses.

Each watches one danger and answers with the speed that is still allowed, or with the brakes. The
strictest counts. None of them takes a word from the game: a message can make a kart slower, never
faster than what is returned here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.limits import CERTAIN, Limits
from race_agents.unit.passage import BLOCKS, leads_past
from race_server.core import codes
from race_server.core.alert import Cause
from race_server.core.messages import Control

Floats = NDArray[np.float64]
# Brakes where there is time: a kart behind is not surprised.
GENTLE = 0.6
# From this share of the brakes on the motor is off, whatever the other foot does.
BRAKE_WINS = 0.5
# How fast a speed above the limit is taken off [1/s], with this share of the brakes at most.
OVER_RATE, OVER_BRAKE = 5.0, 0.7
CREEP = 0.1  # [m/s] a distance that shrinks more slowly is no danger
STRAIGHT = 1e-4  # [1/m] bends flatter than this are driven as straight lines


@dataclass(frozen=True)
class Verdict:
    """What one watch allows."""

    speed: float = math.inf  # [m/s] at most
    brake: float = 0.0  # [0, 1] at least
    motor: float = 1.0  # [0, 1] of the motor's force at most
    cause: Cause = Cause.NONE


STOP_FOR_OBSTACLE = Verdict(brake=1.0, motor=0.0, cause=Cause.OBSTACLE)


@dataclass(frozen=True, eq=False)
class Echoes:
    """What the radar sees, one entry for each ray that something came back on."""

    x: Floats  # (n,) [m] ahead of the rear axle
    y: Floats  # (n,) [m] to the left
    closing: Floats  # (n,) [m/s] by which the distance shrinks
    kinds: NDArray[np.uint8]  # (n,) Hit

    @classmethod
    def nothing(cls) -> "Echoes":
        """Return what a radar in an empty place sees."""
        none = np.zeros(0)
        return cls(none, none, none, np.zeros(0, np.uint8))

    def without_karts(self) -> "Echoes":
        """Return what is left where other karts are not looked at."""
        return self.kept(self.kinds != codes.KART_HIT)

    def without_borders(self) -> "Echoes":
        """Return what does not belong to the course."""
        return self.kept(self.kinds != codes.BORDER)

    def of_people(self) -> "Echoes":
        """Return what is neither a kart nor a border."""
        return self.kept(self.may_be_people)

    @cached_property
    def may_be_people(self) -> NDArray[np.bool_]:
        """Which echoes may be of a person, shape (n,): not every radar tells one from a thing."""
        return (self.kinds == codes.OBSTACLE) | (self.kinds == codes.PERSON)

    def joined(self, other: "Echoes") -> "Echoes":
        """Return these echoes and those of another scan."""
        both = np.concatenate
        return Echoes(
            both([self.x, other.x]),
            both([self.y, other.y]),
            both([self.closing, other.closing]),
            both([self.kinds, other.kinds]),
        )

    def kept(self, kept: NDArray[np.bool_]) -> "Echoes":
        """Return the echoes of a mask (n,)."""
        return Echoes(self.x[kept], self.y[kept], self.closing[kept], self.kinds[kept])


def braking_time(closing: Floats, limits: Limits) -> Floats:
    """Return the times to collision (n,) [s] at which the brakes must be full to stop in time.

    closing: (n,) [m/s] by which the distances shrink. Stopping takes closing²/(2 braking) and the
    way of the reaction: as a time at that speed.
    """
    return limits.reaction_s + np.maximum(closing, 0.0) / (2.0 * limits.braking)


def way_along(x: Floats, y: Floats, curvature: float) -> tuple[Floats, Floats]:
    """Return how far along an arc each point lies and how far beside it [m], inside positive.

    The arc begins at the origin along x; curvature [1/m] is positive to the left.
    """
    if abs(curvature) < STRAIGHT:
        return x, -np.abs(y)
    radius = 1.0 / abs(curvature)
    side = y if curvature > 0.0 else -y
    turned = np.arctan2(x, radius - side)
    return radius * turned, radius - np.hypot(x, radius - side)


def is_on_way(
    along: Floats, aside: Floats, beside: Floats, curvature: float, limits: Limits
) -> NDArray[np.bool_]:
    """Return which points of `way_along` the body sweeps over, or misses by less than `beside` [m].

    In a bend the outer front corner swings out beyond the way of the rear axle.
    """
    outer = limits.half_width
    if abs(curvature) > STRAIGHT:
        radius = 1.0 / abs(curvature)
        outer = math.hypot(radius + limits.half_width, limits.nose) - radius
    return (along > 0.0) & (aside < limits.half_width + beside) & (aside > -outer - beside)


def is_in_danger(
    echoes: Echoes, curvatures: Sequence[float], limits: Limits
) -> list[NDArray[np.bool_]]:
    """Return for each arc which echoes (n,) will be hit unless the kart brakes fully now.

    A kart need not keep a distance from borders: drivers use all of the track. From people it keeps
    a berth. Who walks towards the way is foreseen by `race_agents.unit.danger`.
    """
    is_raced = (echoes.kinds == codes.BORDER) | (echoes.kinds == codes.KART_HIT)
    kept = limits.nose + np.where(is_raced, 0.0, limits.stand_off)
    late_s = 0.5 * limits.reaction_s + np.maximum(echoes.closing, 0.0) / (2.0 * limits.promised)
    time_s = np.where(is_raced, late_s, braking_time(echoes.closing, limits))
    beside = np.where(echoes.may_be_people, limits.berth, np.where(is_raced, -limits.spare, 0.0))
    comes, most = echoes.closing > CREEP, kept + echoes.closing * time_s
    found = []
    for curvature in curvatures:
        along, aside = way_along(echoes.x, echoes.y, curvature)
        is_near = comes & (along < most)
        found.append(is_near & is_on_way(along, aside, beside, curvature, limits))
    return found


def watch_obstacles(
    echoes: Echoes, speed: float, now: float, wanted: float, limits: Limits
) -> Verdict:
    """Brake for what stands in the way, see `in_the_way`."""
    must_brake = in_the_way(echoes, speed, now, wanted, limits).any()
    return STOP_FOR_OBSTACLE if bool(must_brake) else Verdict()


def in_the_way(
    echoes: Echoes,
    speed: float,
    now: float,
    wanted: float,
    limits: Limits,
    *,
    steers: bool = True,
) -> NDArray[np.bool_]:
    """Return which echoes the kart must brake for fully, shape (n,).

    now, wanted: curvature [1/m] that the kart drives, and that its driver steers to. Whatever
    stands on one of these two ways counts, be it a person or a thing; a kart counts on both. The
    border of a bend lies on the way of every kart that is about to turn: it counts where no way
    leads past it. steers: whether the kart goes where its front wheels point; where it slides, no
    person or thing counts for being there.
    """
    if not len(echoes.x):
        return np.zeros(0, np.bool_)
    is_border, is_kart = echoes.kinds == codes.BORDER, echoes.kinds == codes.KART_HIT
    drives, will = is_in_danger(echoes, (now, wanted), limits)
    is_met = (drives | (will & steers)) & ~is_border
    # Who steers past a kart passes it. Where one comes faster than this one drives, brakes take off
    # the smaller part.
    is_met &= ~is_kart | (drives & will & (echoes.closing < 2.0 * speed))
    walls = (drives | will) & is_border
    if (drives & is_border).sum() < BLOCKS or (will & is_border).sum() < BLOCKS:
        return is_met
    is_free = leads_past(echoes.x[is_border], echoes.y[is_border], speed, limits)
    return is_met if is_free else is_met | walls


def ways_out(speed: float, limits: Limits) -> list[float]:
    """Return the curvatures [1/m] that a kart may still steer, from right to left."""
    most = min(limits.sharpest, limits.grip / (CERTAIN * max(speed * speed, 1e-6)))
    return [most * share for share in (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)]


def watch_creeping(echoes: Echoes, wanted: float, room: float, limits: Limits) -> Verdict:
    """Hold a kart from driving on while anything but a border is right before it, at any speed.

    room: [m] to be free.
    """
    return _watch_ways(echoes, (wanted,), room, limits)


def watch_restart(echoes: Echoes, limits: Limits) -> Verdict:
    """Hold a kart that stood for a person until the way is clear, wherever it would steer.

    Steering around what is that near takes it out of the radar's sight and under a front wheel.
    """
    return _watch_ways(echoes, ways_out(0.0, limits), limits.restart, limits)


def _watch_ways(
    echoes: Echoes, curvatures: Sequence[float], room: float, limits: Limits
) -> Verdict:
    """Hold a kart before which anything but a border stands on one of some arcs.

    No way is shorter than the straight one, and no body reaches farther beside its arc than its
    corner and the berth: what is farther than that is left out at once.
    """
    far = room + limits.nose + math.hypot(limits.half_width, limits.nose) + limits.berth
    near = echoes.x * echoes.x + echoes.y * echoes.y < far * far
    echoes = echoes.kept(near & (echoes.kinds != codes.BORDER))
    if not len(echoes.x):
        return Verdict()
    beside = np.where(echoes.may_be_people, limits.berth, 0.0)
    for curvature in curvatures:
        along, aside = way_along(echoes.x, echoes.y, curvature)
        met = is_on_way(along, aside, beside, curvature, limits) & (along - limits.nose < room)
        if met.any():
            return STOP_FOR_OBSTACLE
    return Verdict()


def watch_driver(age_s: float, limits: Limits) -> Verdict:
    """Coast, then stop, when the driver's input gets old: the dead man's handle."""
    if age_s > limits.let_go_s:
        return Verdict(brake=GENTLE, motor=0.0, cause=Cause.DRIVER)
    return Verdict(motor=0.0, cause=Cause.DRIVER) if age_s > limits.coast_s else Verdict()


def watch_game(age_s: float, limits: Limits) -> Verdict:
    """Coast, then stop, when nothing comes from the program that brings orders and driver."""
    if age_s > limits.game_stop_s:
        return Verdict(brake=GENTLE, motor=0.0, cause=Cause.GAME)
    return Verdict(motor=0.0, cause=Cause.GAME) if age_s > limits.game_coast_s else Verdict()


def watch_link(age_s: float, valid_s: float, limits: Limits) -> Verdict:
    """Slow down, then stop, when nothing comes from the server.

    valid_s: for how long its last word says that it holds; no word can switch this watch off.
    """
    valid_s = min(valid_s, limits.most_valid_s)
    if age_s > valid_s:
        return Verdict(brake=GENTLE, motor=0.0, cause=Cause.LINK)
    return Verdict(limits.slow_speed, cause=Cause.LINK) if age_s > 0.6 * valid_s else Verdict()


def watch_speed(speed: float, limits: Limits) -> Verdict:
    """Allow the top speed of the kart and nothing more; no radar looks back, so less in reverse."""
    most = limits.top_speed if speed >= 0.0 else limits.reverse_speed
    return Verdict(most, cause=Cause.SPEED if abs(speed) > most else Cause.NONE)


def watch_fence(beyond: float, limits: Limits) -> Verdict:
    """Slow down outside the course. beyond: [m] outside the kerb, negative inside."""
    if beyond <= limits.fence:
        return Verdict()
    return Verdict(limits.slow_speed, cause=Cause.FENCE)


def watch_place(deviation: float, limits: Limits, *, is_doubtful: bool) -> Verdict:
    """Slow down where the kart does not know where it is.

    deviation: [m] of its position; is_doubtful: fixes come that disagree with it.
    """
    if deviation <= 2.0 * limits.half_width and not is_doubtful:
        return Verdict()
    return Verdict(limits.slow_speed, cause=Cause.LOST)


def watch_sensors(limits: Limits, *, is_blind: bool, is_lame: bool) -> Verdict:
    """Stop a kart that cannot see ahead; slow down one that does not know how it moves."""
    if is_blind:
        return Verdict(brake=1.0, motor=0.0, cause=Cause.SENSOR)
    return Verdict(limits.slow_speed, cause=Cause.SENSOR) if is_lame else Verdict()


@dataclass(frozen=True)
class Command:
    """What goes to the actuators, and why."""

    steering: float = 0.0  # [-1, 1]
    throttle: float = 0.0  # [-1, 1]
    brake: float = 1.0  # [0, 1]
    cause: Cause = Cause.NONE


def combine(
    driver: Control,
    speed: float,
    verdicts: Sequence[Verdict],
    limits: Limits,
    *,
    game_speed: float = math.inf,
    thrust: float = 1.0,
) -> Command:
    """Return the driver's command within what the game leaves of it and what the reflex allows.

    game_speed, thrust: the game's cap [m/s] and its share of the motor. The least throttle and the
    most brake count; steering stays the driver's.
    """
    allowed, brake, causes = game_speed, driver.brake, 0
    motor = max(0.0, min(thrust, 1.0))  # a share below 0 would turn the pedal round
    for verdict in verdicts:
        allowed, motor = min(allowed, verdict.speed), min(motor, verdict.motor)
        brake = max(brake, verdict.brake)
        causes |= verdict.cause.value
    if brake >= BRAKE_WINS:
        motor = 0.0
    over = abs(speed) - allowed
    if over > 0.0:
        brake = max(brake, min(OVER_RATE * over / limits.braking, OVER_BRAKE))
    # Near the limit the motor fades out, so that it is met softly.
    room = max(-over, 0.0) / max(0.05 * allowed, 0.05)
    throttle = max(-1.0, min(driver.throttle, 1.0)) * motor
    throttle = math.copysign(min(abs(throttle), room), throttle)
    return Command(driver.steering, throttle, brake, Cause(causes))
