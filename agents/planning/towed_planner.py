"""Plans ways of a vehicle with one trailer into a slot, among walls and boxes."""

import math
from itertools import pairwise
from typing import Any

import numpy as np

from race_agents.planning.hybrid_astar import (
    GAVE_UP,
    Mesh,
    Task,
    Towing,
    search,
    towed_at,
)
from race_agents.planning.path import in_words
from race_agents.planning.path_planner import ENDLESS, MARGIN, REACH, disc_around_axle
from race_agents.planning.rig_moves import DOCKED, InLine, direction_in, drive, way_in
from race_agents.planning.search_tree import NODES, NONE, STEPS, make_tree
from race_agents.planning.towed_path import TowedPath
from race_server.core.free_space.ground import NO_BOXES, Ground, farthest_wall
from race_server.core.free_space.obstacles import CORNER, PASSING, Obstacles, cover_radius, is_free
from race_server.core.free_space.prices import Prices
from race_server.core.free_space.rig import (
    Rig,
    Towed,
    only_trailer,
    pose_ahead,
    rig_of,
    scale_of,
    towed_by,
)
from race_server.core.free_space.towed_ways import NO_WAYS, find_towed_ways
from race_server.core.kernels.distance_field import distance_at
from race_server.core.kernels.geometry import Pose
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError

# Share of the greatest curvature that paths have: reversing needs more of it for corrections.
LOCK = 0.9
# Cost of a change of direction [m], and how far around start and goal a path may lead, in bars.
CUSP, REACH_BARS = 6.0, 3.0
# What is tried, until one holds a path, for the usual bar; lengths of others are in proportion. Of
# each, whether it estimates by `towed_ways`: those know the obstacles, and where they mislead, as
# some do whose hitch takes long to bend, the shortest path of a car does not. The last two are for
# yards in which a lorry cannot turn at once.
_COARSE = Mesh(3.0, 0.6, 1.5, 1.5, math.radians(10.0), 0.25, greed=2.0, nodes=5_000)
MESHES = (
    (_COARSE, True),
    (_COARSE._replace(nodes=20_000), False),
    (Mesh(1.5, 0.4, 0.75, 0.75, math.radians(6.0), 0.25, greed=3.0, nodes=40_000), True),
    (Mesh(1.0, 0.4, 0.5, 0.5, math.radians(5.0), 0.25, greed=1.5, nodes=40_000), True),
)
# Most steps of a way, see `rig_moves.drive`.
MOST_STEPS = 4096


class TowedPlanner:
    """Plans for one vehicle. Its work space is made once, so it plans one path at a time."""

    def __init__(
        self, vehicle: Vehicle, *, margin: float = MARGIN, lock: float = LOCK, back: float = 1.0
    ) -> None:
        """Make room.

        margin: distance kept from obstacles [m]; lock: share of the curvature; back: what a metre
        in reverse costs, as a multiple of one forward, at least 1.

        Raises:
            PlanError: the vehicle does not draw just one trailer.
        """
        self.vehicle, self.margin = vehicle, margin
        self.trailer = only_trailer(vehicle)
        self.rig = rig_of(vehicle, margin, lock)
        scale = scale_of(self.trailer.bar)
        self._prices = Prices(1.0, back, CUSP * scale)
        self._meshes = [(_scaled(mesh, scale), is_told) for mesh, is_told in MESHES]
        self._reach = max(REACH, REACH_BARS * self.trailer.bar)
        self._tree = make_tree(max(mesh.nodes for mesh, _ in MESHES))
        self._ground = Ground()
        self._rows = np.zeros((MOST_STEPS, 3))
        self._most_steps = ENDLESS

    def allow(self, steps: int) -> None:
        """Let all plans from now on take this number of steps together, see `PathPlanner`."""
        self._most_steps = steps
        self._tree.counts[STEPS] = 0

    @property
    def steps(self) -> int:
        """Steps that were taken since they were allowed."""
        return int(self._tree.counts[STEPS])

    def plan(
        self,
        start: Pose,
        angle: float,
        goal: Pose,
        walls: Floats,
        boxes: Floats = NO_BOXES,
        asked: InLine = DOCKED,
    ) -> TowedPath:
        """Return a path that keeps the margin from walls and boxes, and ends in line.

        start: of the rear axle of the vehicle; angle: at the hitch [rad]; goal: of the axle of the
        trailer; walls: (P, 4) x0, y0, x1, y1 [m]; boxes: (B, 6) x, y [m] of the middle, cosine and
        sine of the heading, half length, half width [m]; asked: how they are to stand at the goal.

        Raises:
            PlanError: start or goal touches something, no way leads from one to the other, or none
                was found.
        """
        towed = towed_by(self.rig, start, math.remainder(angle, 2.0 * math.pi), math.inf)
        root = Pose(towed.x, towed.y, towed.heading)
        between = (
            f"{in_words(start)} with the hitch at {math.degrees(angle):.0f}° to {in_words(goal)}"
        )
        # Near by first: of a large area the grid has larger cells.
        for reach in (self._reach, max(self._reach, farthest_wall(root, goal, walls))):
            obstacles = self._obstacles(root, goal, walls, boxes, reach)
            self._require_room("start", towed, obstacles)
            self._require_room("goal", Towed(*goal, 0.0, 0.0), obstacles)
            distances = self._distances_to(goal, obstacles)
            if distance_at(obstacles.grid, distances, root.x, root.y) < math.inf:
                break
        else:
            raise PlanError(
                f"no way leads from {between}: what is free around one is cut off from the other, "
                f"or joined to it only farther than {reach:.1f} m aside"
            )
        ways = find_towed_ways(obstacles, distances, self.rig, goal, self._prices)
        costs = np.zeros(0)
        for mesh, is_told in self._meshes:
            towing = Towing(self.rig, towed, asked, ways if is_told else NO_WAYS, self._rows)
            fixed = (root, goal, self.rig.drawn, obstacles, distances, self._prices, costs)
            task = Task(*fixed, mesh, self._most_steps)
            node, _ = search(task, towing, self._tree)
            if node >= 0:
                return self._path(task, towing, node)
            if self.steps >= self._most_steps:
                break
        found = int(self._tree.counts[NODES])
        raise PlanError(
            f"no path from {between}: the search "
            + (f"gave up after {found} states" if node == GAVE_UP else "found no further state")
            + "; make the slot or the yard wider, or choose another goal"
        )

    def is_free(self, pose: Pose, angle: float, walls: Floats, boxes: Floats = NO_BOXES) -> bool:
        """Return whether vehicle and trailer keep the margin there; arguments as for `plan`."""
        towed = towed_by(self.rig, pose, angle, 0.0)
        place = Pose(towed.x, towed.y, towed.heading)
        obstacles = self._obstacles(place, place, walls, boxes, self._reach)
        return abs(angle) <= self.rig.limit and _is_free(obstacles, self.rig, towed)

    def _obstacles(
        self, start: Pose, goal: Pose, walls: Floats, boxes: Floats, reach: float
    ) -> Obstacles:
        near = PASSING + max(cover_radius(self.rig.drawing), cover_radius(self.rig.drawn))
        return self._ground.obstacles(start, goal, walls, boxes, reach=reach, near=near)

    def _distances_to(self, goal: Pose, obstacles: Obstacles) -> Floats:
        least = max(disc_around_axle(self.rig.drawn) - CORNER * obstacles.grid.cell, 0.0)
        return self._ground.distances_to(goal, obstacles, least)

    def _require_room(self, name: str, towed: Towed, obstacles: Obstacles) -> None:
        where = f"the {name}, {in_words(pose_ahead(self.rig, towed))}"
        if abs(towed.angle) > self.trailer.limit:
            raise PlanError(
                f"{where}, has an angle of {math.degrees(towed.angle):.0f}° at the hitch, whose "
                f"limit is {math.degrees(self.trailer.limit):.0f}°: straighten the vehicle first"
            )
        if _is_free(obstacles, self.rig, towed):
            return
        if _is_free(obstacles, rig_of(self.vehicle, 0.0, 1.0), towed):
            raise PlanError(
                f"{where}, is nearer to an obstacle than the margin of {self.margin:g} m; choose "
                "another pose, or plan with a smaller margin"
            )
        raise PlanError(f"{where}, is inside of a wall or a box; choose another pose")

    def _path(self, task: Task, towing: Towing, node: int) -> TowedPath:
        """Return the path from the root to a node, and from there into the slot."""
        nodes = self._tree.nodes
        chain: list[Any] = []
        while node != NONE:
            chain.insert(0, nodes[node])
            node = int(nodes[node].parent)
        parts = []
        for before, after in pairwise(chain):
            start, way = towed_at(before, float(after.way)), float(after.way)
            wanted = float(after.wanted)
            _, way = drive(task.obstacles, self.rig, start, task.goal, wanted, way, self._rows)
            parts.append(self._driven(way))
        last = chain[-1]
        way = direction_in(task.goal, Pose(last.x, last.y, last.heading))
        start = towed_at(last, way)
        parts.append(
            self._driven(
                way_in(task.obstacles, self.rig, start, task.goal, towing.asked, way, self._rows)
            )
        )
        rows = np.concatenate(parts)
        angles = np.concatenate([[towing.start.angle], rows[:, 2]])
        return TowedPath(Pose(*pose_ahead(self.rig, towing.start)), rows[:, :2], angles)

    def _driven(self, way: float) -> Floats:
        """Return the steps of the last `way` metres that were driven: (n, 3), see `drive`."""
        driven = np.cumsum(np.abs(self._rows[:, 1]))
        return self._rows[: int(np.searchsorted(driven, abs(way) - 1e-9)) + 1].copy()


def _is_free(obstacles: Obstacles, rig: Rig, towed: Towed) -> bool:
    """Return whether both bodies touch nothing."""
    place = Pose(towed.x, towed.y, towed.heading)
    return is_free(obstacles, rig.drawn, place) and is_free(
        obstacles, rig.drawing, pose_ahead(rig, towed)
    )


def _scaled(mesh: Mesh, scale: float) -> Mesh:
    lengths = {name: scale * getattr(mesh, name) for name in ("step", "least", "along", "across")}
    return mesh._replace(**lengths)
