"""A teacher that plans: it labels what a learner sees on its way to a slot with a trailer.

A plan takes a hundredth of a second or more, a label along it a microsecond. So each way is planned
once, and its controllers say at every decision what leads back to it and along it, until the
vehicle is so far off that another way is planned from there. The learner does not see the plan. So
that the same plan belongs to the same place, all slots but its own are taken for occupied where the
lot may occupy them, whichever are: what the round has drawn there does not matter.
"""

import numpy as np
from numpy.typing import NDArray

from race_agents.planning.parking_plan import chart_of, parked_trailer_pose
from race_agents.planning.path_follower import COLUMNS
from race_agents.planning.towed_follower import label_all, make_towed_track
from race_agents.planning.towed_planner import TowedPlanner
from race_agents.training.lot_teacher import Labels, LotTeacher
from race_server.core.free_space.rig import rig_of
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.trailers import axle_pose, hitch_angle
from race_server.core.parking_order import order_of
from race_server.envs.batch import Batch
from race_server.envs.parking.heuristics.atlas import standing_in
from race_server.errors import PlanError

# Distances kept from obstacles [m], and steps of the search for a way, see `TowedPlanner.allow`. A
# learner needs more room than a planner; the next one is tried where no way keeps the one before.
MARGINS = ((0.3, 4_000), (0.05, 12_000))
# Points of a way.
MOST_POINTS = 2048
# Decisions until a way is looked for again where there was none.
PAUSE = 30


class PlanningTeacher(LotTeacher):
    """Plans for the vehicle of every world of a batch."""

    def __init__(self, batch: Batch) -> None:
        """Prepare a planner.

        Raises:
            ScenarioError: the vehicles do not learn alone, or have other actions than `dock`.
            PlanError: they do not draw just one trailer.
        """
        super().__init__(batch, "dock")
        self._planners = [TowedPlanner(self._vehicle, margin=margin) for margin, _ in MARGINS]
        self._rig = rig_of(self._vehicle, 0.0, 1.0)
        self._tracks = np.zeros((batch.worlds, MOST_POINTS, COLUMNS))
        self._counts = np.zeros(batch.worlds, np.int64)  # points of each way; 0: there is none
        self._ages = np.zeros(batch.worlds, np.int64)  # decisions since each was planned
        self._progress = np.zeros((batch.worlds, 1))
        self._waits = np.zeros(batch.worlds, np.int64)
        self._controls = np.zeros((batch.worlds, 2))
        self.plans = 0

    def labels(self, seen: NDArray[np.float32], begun: NDArray[np.bool_]) -> Labels:
        """Return the actions that lead along the ways, none where there is no way."""
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
        lots = world.parking.lots
        lot, own = lots.lots[world.rules[w].course], int(world.parking.parkers[w, 0].slot)
        others = standing_in(lots, lot, own)
        goal, walls = parked_trailer_pose(order.slot, self._vehicle), order.walls
        boxes = np.unique(np.concatenate([chart_of(order).boxes, others]), axis=0)
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
