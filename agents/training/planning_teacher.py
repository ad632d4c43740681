"""A teacher that plans: it labels what a learner sees on its way to a slot with a trailer.

A plan takes a hundredth of a second or more, a label along it a microsecond. So each way is planned
once, and its controllers say at every decision what leads back to it and along it, until the
vehicle is so far off that another way is planned from there. The learner does not see the plan. So
that the same plan belongs to the same place, all slots but its own are taken for occupied where the
lot may occupy them, whichever are: what the round has drawn there does not matter.
"""

import math

import numpy as np
from numpy.typing import NDArray

from race_agents.planning.parking_plan import chart_of, parked_trailer_pose
from race_agents.planning.path_follower import (
    ANGLE,
    COLUMNS,
    CURVATURE,
    GEAR,
    HEADING,
    LAST,
    SPEED,
    STANDING,
    Spot,
    X,
    Y,
    locate,
)
from race_agents.planning.rig import Rig, rig_of, way_behind
from race_agents.planning.towed_follower import (
    LEAST_RATIO,
    axle_of,
    follow_towed,
    guided_axle,
    make_towed_track,
)
from race_agents.planning.towed_planner import TowedPlanner
from race_server.core.kernels.geometry import Pose, cos_sin, wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.motion import Motion
from race_server.core.kernels.trailers import axle_pose, hitch_angle
from race_server.core.parking_order import order_of
from race_server.core.state import Floats, Ints, Record, Records, World
from race_server.envs.actions import LEAST_SPEED
from race_server.envs.batch import Batch
from race_server.errors import PlanError, ScenarioError

Labels = NDArray[np.float32]

ACTION = "dock"  # what it answers with

# Distances kept from obstacles [m], and steps of the search for a way, see `TowedPlanner.allow`. A
# learner needs more room than a planner; the next one is tried where no way keeps the one before.
MARGINS = ((0.3, 4_000), (0.05, 12_000))
# Points of a way.
MOST_POINTS = 2048
# A vehicle that is farther than this from its way [m], or turned [rad], or whose hitch has another
# angle than planned by more than this [rad], gets another way. So does one that drives against its
# way, faster than this [m/s]: it turned round where another way does, and may well go on.
AWAY, TURNED, BENT, AGAINST = 1.0, 0.4, 0.5, 0.3
# Decisions for which a way is kept against which a vehicle drives.
KEPT = 20
# Decisions until a way is looked for again where there was none.
PAUSE = 30
# Slower than this [m/s] a vehicle stands, as far as labels are concerned.
SLOW = 0.1


class PlanningTeacher:
    """Plans for the vehicle of every world of a batch."""

    def __init__(self, batch: Batch) -> None:
        """Prepare a planner.

        Raises:
            ScenarioError: the vehicles do not learn alone, or have other actions than `dock`.
            PlanError: they do not draw just one trailer.
        """
        if batch.task.action != ACTION:
            raise ScenarioError(
                f"action = {batch.task.action!r}: a teacher that plans answers with a speed and "
                f"steering; choose {ACTION!r}"
            )
        if batch.learners != 1:
            raise ScenarioError(
                f"race.learners = {batch.learners}: a teacher that plans has one vehicle in each "
                "lot; choose 1"
            )
        vehicle = batch.scenarios[0].vehicle_of(0)
        self._batch, self._vehicle = batch, vehicle
        self._planners = [TowedPlanner(vehicle, margin=margin) for margin, _ in MARGINS]
        self._rig = rig_of(vehicle, 0.0, 1.0)
        self._tracks = np.zeros((batch.worlds, MOST_POINTS, COLUMNS))
        self._counts = np.zeros(batch.worlds, np.int64)  # points of each way; 0: there is none
        self._ages = np.zeros(batch.worlds, np.int64)  # decisions since each was planned
        self._progress = np.zeros((batch.worlds, 1))
        self._waits = np.zeros(batch.worlds, np.int64)
        self._controls = np.zeros((batch.worlds, 2))
        self.plans = 0

    def labels(self, seen: NDArray[np.float32], begun: NDArray[np.bool_]) -> Labels:
        """Return the actions that lead along the ways, shape (W, 2); not a number without a way.

        seen: what the learners see, which does not matter here; begun: (W, 1) true where an episode
        has just begun.
        """
        del seen
        self._counts[begun[:, 0]] = 0
        self._waits[begun[:, 0]] = 0
        self._label()
        for w in np.flatnonzero(self._counts == 0):
            self._plan(int(w))
        self._label()
        self._waits = np.maximum(self._waits - 1, 0)
        self._ages += 1
        return self._controls.astype(np.float32)

    def record_driven(self, actions: NDArray[np.float32]) -> None:
        """Do nothing: it looks where the vehicles are."""

    def _label(self) -> None:
        label_all(
            self._batch.world.bodies,
            self._batch.world.vehicles,
            self._rig,
            self._tracks,
            self._counts,
            self._ages,
            self._progress,
            self._controls,
        )

    def _plan(self, w: int) -> None:
        """Plan a way for one world, unless that failed a short while ago."""
        if self._waits[w] > 0:
            return
        world = self._batch.world
        body, record, order = world.bodies[w, 0], world.vehicles[w, 0], order_of(world, w, 0)
        start, angle = Pose(*axle_pose(body, record, 0)), float(hitch_angle(body, 0))
        goal, walls = parked_trailer_pose(order.slot, self._vehicle), order.walls
        boxes = np.unique(np.concatenate([chart_of(order).boxes, occupied(world, w, 0)]), axis=0)
        for planner, (_, steps) in zip(self._planners, MARGINS, strict=True):
            planner.allow(steps)
            self.plans += 1
            try:
                path = planner.plan(start, angle, goal, walls, boxes)
                track = make_towed_track(path, self._vehicle, self._vehicle.top_speed)
            except PlanError:
                continue
            if len(track) <= MOST_POINTS:
                self._tracks[w, : len(track)], self._counts[w] = track, len(track)
                self._progress[w], self._ages[w] = 0.0, 0
                return
        self._waits[w] = PAUSE


def occupied(world: World, w: int, k: int) -> Floats:
    """Return the boxes of all that may stand in the slots but that of vehicle k: (B, 6).

    A box: see `Chart`. None where the lot leaves its slots free.
    """
    lots = world.parking.lots
    lot, own = lots.lots[world.rules[w].course], int(world.parking.parkers[w, k].slot)
    if lot.taken == 0.0:
        return np.zeros((0, 6))
    slots = lots.slots[lot.slot_start : lot.slot_start + lot.slot_count]
    others = slots[np.arange(len(slots)) != own]
    boxes = np.zeros((len(others), 6))
    boxes[:, 0], boxes[:, 1] = others["x"], others["y"]
    boxes[:, 2], boxes[:, 3] = np.cos(others["heading"]), np.sin(others["heading"])
    boxes[:, 4:] = 0.5 * lot.taken_length, 0.5 * lot.taken_width
    return boxes


@large_kernel
def label_all(
    bodies: Records,
    vehicles: Records,
    rig: Rig,
    tracks: Floats,
    counts: Ints,
    ages: Ints,
    progress: Floats,
    controls: Floats,
) -> None:
    """Fill `controls`, (W, 2) speed and steering as shares, from the way of each world.

    bodies, vehicles: (W, 1) BODY and VEHICLE; tracks: (W, S, COLUMNS), of which the first `counts`,
    (W,), are a way, none where a vehicle is astray; ages: (W,) decisions since it was planned;
    progress: (W, 1), see `follow_towed`.
    """
    for w in range(len(bodies)):
        body, vehicle = bodies[w, 0], vehicles[w, 0]
        controls[w, 0] = controls[w, 1] = math.nan
        if counts[w] == 0:
            continue
        track = tracks[w, : counts[w]]
        speed = body.speed if abs(body.speed) >= SLOW else 0.0
        motion = Motion(
            body.x, body.y, body.heading, speed, body.lateral_speed, body.yaw_rate, body.steering
        )
        angle = hitch_angle(body, 0)
        cap = 2.0 * vehicle.top_speed
        command = follow_towed(track, progress[w], vehicle, rig, motion, angle, cap)
        row = track[int(progress[w, 0])]
        led = guided_axle(rig, axle_of(vehicle, motion), angle, row[GEAR])
        is_against = speed * row[GEAR] < -AGAINST and ages[w] >= KEPT
        if is_against or _is_astray(row, led, angle):
            counts[w] = 0
            continue
        spot = locate(track, progress[w], led.x, led.y, motion.speed)
        controls[w, 0] = _wanted_speed(track, spot, vehicle, rig)
        controls[w, 1] = command.steering
        if spot.arrived and row[LAST] == counts[w] - 1 and abs(body.speed) < STANDING:
            counts[w] = 0  # it would have ended here, so it does not stand well enough


@kernel
def _wanted_speed(track: Floats, spot: Spot, vehicle: Record, rig: Rig) -> float:
    """Return the speed at a spot of a way, as a share of the most in that direction.

    At the end of a leg it turns round, so that the vehicle stands for a moment.
    """
    row, after = track[spot.point], track[spot.point + 1]
    gear = row[GEAR]
    ratio = 1.0
    if gear < 0.0:
        ratio = max(way_behind(rig, row[ANGLE], row[CURVATURE]), LEAST_RATIO)
    speed = gear * max((row[SPEED] + spot.share * (after[SPEED] - row[SPEED])) / ratio, LEAST_SPEED)
    if spot.arrived:
        speed = -gear * LEAST_SPEED
    return speed / (vehicle.top_speed if speed > 0.0 else vehicle.reverse_speed)


@kernel
def _is_astray(row: Floats, led: Pose, angle: float) -> bool:
    """Return whether a vehicle is too far from a point of its way, (COLUMNS,), to come back.

    led: the axle that is led; angle: at the hitch [rad].
    """
    cos, sin = cos_sin(wrap_angle(row[HEADING]))
    x, y = led.x - row[X], led.y - row[Y]
    is_away = max(abs(x * cos + y * sin), abs(y * cos - x * sin)) > AWAY
    is_turned = abs(wrap_angle(led.heading - row[HEADING])) > TURNED
    return is_away or is_turned or abs(wrap_angle(angle - row[ANGLE])) > BENT
