"""Plans paths of a vehicle from pose to pose among walls and boxes."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from race_agents.planning.analytic_expansion import LEAST_PIECE
from race_agents.planning.halfway import halfway_poses
from race_agents.planning.hybrid_astar import CURVATURES, GAVE_UP, Mesh, Task, search
from race_agents.planning.path import Path, driven_back, in_words, path_of
from race_agents.planning.search_tree import NODES, NONE, STEPS, make_tree
from race_agents.planning.shortcuts import shortened
from race_server.core.free_space.footprint import Footprint, footprint_of
from race_server.core.free_space.ground import NO_BOXES, Ground, farthest_wall
from race_server.core.free_space.obstacles import (
    CORNER,
    PASSING,
    Obstacles,
    cover_radius,
    free_way,
    is_free,
)
from race_server.core.free_space.prices import CUSP, Prices
from race_server.core.kernels.distance_field import distance_at
from race_server.core.kernels.geometry import Pose, along_arc
from race_server.core.kernels.reeds_shepp import WORDS, word_between
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError

# Distance [m] kept from obstacles.
MARGIN = 0.05
# Share of the greatest curvature that paths have: with all of it no error could be corrected.
LOCK = 0.95
# How far around start and goal [m] a path may lead.
REACH = 12.0
# How far [m] the room around a pose is measured along each arc.
ROOM = 3.0
# A pose from which the vehicle gets less far [m] over all arcs is in a slot: it gets 2 to 6 m in
# slots, at least 8 m in the aisles before them.
NARROW = 7.0
# From coarse to fine, until one of them holds a path. In slots only 0.6 m longer than a car, a move
# gains a few centimetres aside: coarse cells across the slot would take it for standing still.
MESHES = (
    Mesh(0.8, 0.10, 0.40, 0.400, math.radians(5.0), 1.0, greed=1.2, nodes=60_000),
    Mesh(0.8, 0.05, 0.10, 0.100, math.radians(2.0), 1.0, greed=1.4, nodes=20_000),
    Mesh(0.8, 0.05, 0.10, 0.020, math.radians(1.0), 1.0, greed=1.6, nodes=200_000),
    Mesh(0.8, 0.02, 0.05, 0.005, math.radians(0.5), 1.0, greed=1.6, nodes=200_000),
)
# What looks no farther than it must: a way that is longer than need be, in a tenth of the steps.
# Of the steps that a plan may take this share is left for it, where the others find none.
EAGER = Mesh(0.8, 0.10, 0.40, 0.400, math.radians(5.0), 1.0, greed=3.0, nodes=60_000)
EAGER_SHARE = 0.25
# As many steps as a search likes to take.
ENDLESS = 1 << 62


class _CutOffError(PlanError):
    """No way leads from start to goal within reach."""


class PathPlanner:
    """Plans for one vehicle. Its work space is made once, so it plans one path at a time."""

    def __init__(
        self, vehicle: Vehicle, *, margin: float = MARGIN, lock: float = LOCK, back: float = 1.0
    ) -> None:
        """Make room.

        margin: distance kept from obstacles [m]; lock: share of the curvature; back: what a metre
        in reverse costs, as a multiple of one forward, at least 1.
        """
        self.vehicle = vehicle
        self.margin = margin
        self.back = back
        self.footprint = footprint_of(vehicle, margin, lock)
        self._tree = make_tree(max(mesh.nodes for mesh in MESHES))
        self._ground = Ground()
        self._costs = np.zeros(len(WORDS))
        self._most_steps = ENDLESS

    def allow(self, steps: int) -> None:
        """Let all plans from now on take this number of steps together.

        A step is a state expanded, or words tried. A bound in time would give other plans on
        another machine.
        """
        self._most_steps = steps
        self._tree.counts[STEPS] = 0

    @property
    def steps(self) -> int:
        """Steps that were taken since they were allowed."""
        return int(self._tree.counts[STEPS])

    def plan(self, start: Pose, goal: Pose, walls: Floats, boxes: Floats = NO_BOXES) -> Path:
        """Return a path of the rear axle that keeps the margin from walls and boxes.

        start, goal: of the rear axle; walls: (P, 4) x0, y0, x1, y1 [m]; boxes: (B, 6) x, y [m] of
        the middle, cosine and sine of the heading, half length, half width [m].

        Raises:
            PlanError: start or goal is not finite or touches something, no way leads from one to
                the other, or none was found.
        """
        for name, pose in (("start", start), ("goal", goal)):
            if not all(map(math.isfinite, pose)):
                raise PlanError(f"the {name}, {in_words(pose)}, is no place: give finite numbers")
        # Near by first: of a large area the grid has larger cells.
        try:
            return self._plan(start, goal, walls, boxes, REACH)
        except _CutOffError:
            farther = farthest_wall(start, goal, walls)
            if farther <= REACH:
                raise
        return self._plan(start, goal, walls, boxes, farther)

    def _plan(self, start: Pose, goal: Pose, walls: Floats, boxes: Floats, reach: float) -> Path:
        """Return a path that leaves the rectangle around start and goal by `reach` [m] at most."""
        obstacles = self._obstacles(start, goal, walls, boxes, reach)
        for name, pose in (("start", start), ("goal", goal)):
            self._require_room(name, pose, obstacles)
        rooms = self._room(obstacles, start), self._room(obstacles, goal)
        path = None
        if max(rooms) < NARROW:
            path = self._from_slot_to_slot(start, goal, obstacles)
        if path is None:
            path = self._join(start, goal, obstacles, MESHES)
        prices = Prices(1.0, self.back)
        return shortened(path, obstacles, self.footprint, prices, self._costs)

    def _join(self, start: Pose, goal: Pose, obstacles: Obstacles, meshes: Sequence[Mesh]) -> Path:
        """Return a path between two poses that are free.

        Raises:
            PlanError: no way leads from one to the other, or none was found.
        """
        is_swapped = self._room(obstacles, goal) < self._room(obstacles, start)
        root, target = (goal, start) if is_swapped else (start, goal)
        distances = self._distances_to(target, obstacles)
        if distance_at(obstacles.grid, distances, root.x, root.y) == math.inf:
            raise _CutOffError(
                f"no way leads from {in_words(start)} to {in_words(goal)}: what is free around one "
                "is cut off from the other"
            )
        # What is found from the goal is driven the other way round.
        prices = Prices(self.back, 1.0) if is_swapped else Prices(1.0, self.back)
        careful = self._most_steps - int(EAGER_SHARE * self._most_steps)
        for mesh in (*meshes, EAGER):
            is_last = mesh is EAGER
            if is_last and self.steps < careful:
                break
            task = Task(
                root,
                target,
                self.footprint,
                obstacles,
                distances,
                prices,
                self._costs,
                mesh,
                self._most_steps if is_last else careful,
            )
            node, word = search(task, None, self._tree)
            if node >= 0:
                path = self._path(task, node, word)
                return replace(driven_back(path), start=start) if is_swapped else path
        found = int(self._tree.counts[NODES])
        raise PlanError(
            f"no path from {in_words(start)} to {in_words(goal)}: the search "
            + (f"gave up after {found} states" if node == GAVE_UP else "found no further state")
            + "; make the slot or the aisle wider, or choose another goal"
        )

    def _from_slot_to_slot(self, start: Pose, goal: Pose, obstacles: Obstacles) -> Path | None:
        """Return a path out of one narrow place into another, None if none is found so.

        A search has to hit the second slot from outside: where a coarse one does not, two meet.
        """
        with suppress(PlanError):
            return self._join(start, goal, obstacles, MESHES[:1])
        best, least = None, math.inf
        distances = self._distances_to(goal, obstacles)
        for between in halfway_poses(obstacles, distances, start):
            if not is_free(obstacles, self.footprint, between):
                continue
            with suppress(PlanError):
                out = self._join(start, between, obstacles, MESHES)
                into = self._join(between, goal, obstacles, MESHES)
                path = path_of(start, np.concatenate([out.arcs, into.arcs]))
                ahead, back = path.arcs[:, 1].clip(min=0.0), path.arcs[:, 1].clip(max=0.0)
                cost = ahead.sum() - self.back * back.sum() + CUSP * path.changes
                if cost < least:
                    best, least = path, cost
        return best

    def is_free(self, pose: Pose, walls: Floats, boxes: Floats = NO_BOXES) -> bool:
        """Return whether the vehicle keeps the margin there; arguments as for `plan`."""
        return is_free(self._obstacles(pose, pose, walls, boxes, REACH), self.footprint, pose)

    def is_free_straight(
        self, start: Pose, way: float, walls: Floats, boxes: Floats = NO_BOXES
    ) -> bool:
        """Return whether the vehicle keeps the margin on a straight way [m], back if negative."""
        obstacles = self._obstacles(start, along_arc(start, 0.0, way), walls, boxes, REACH)
        is_begun = is_free(obstacles, self.footprint, start)
        return is_begun and free_way(obstacles, self.footprint, start, 0.0, way) == way

    def _obstacles(
        self, start: Pose, goal: Pose, walls: Floats, boxes: Floats, reach: float
    ) -> Obstacles:
        """Return the obstacles around start and goal, with a grid over them."""
        # Beyond the discs that cover the vehicle it does not matter how far an obstacle is.
        near = cover_radius(self.footprint) + PASSING
        return self._ground.obstacles(start, goal, walls, boxes, reach=reach, near=near)

    def _require_room(self, name: str, pose: Pose, obstacles: Obstacles) -> None:
        if is_free(obstacles, self.footprint, pose):
            return
        where = f"the {name}, {in_words(pose)}"
        if is_free(obstacles, footprint_of(self.vehicle, 0.0, 1.0), pose):
            raise PlanError(
                f"{where}, is nearer to an obstacle than the margin of {self.margin:g} m; choose "
                "another pose, or plan with a smaller margin"
            )
        raise PlanError(f"{where}, is inside of a wall or a box; choose another pose")

    def _room(self, obstacles: Obstacles, pose: Pose) -> float:
        """Return how far [m] the vehicle gets from a pose, over all arcs."""
        radius = self.footprint.radius
        return sum(
            abs(free_way(obstacles, self.footprint, pose, curvature / radius, way))
            for curvature in CURVATURES
            for way in (-ROOM, ROOM)
        )

    def _distances_to(self, goal: Pose, obstacles: Obstacles) -> Floats:
        """Return the distance [m] from each cell to a goal: (rows, columns)."""
        least = disc_around_axle(self.footprint) - CORNER * obstacles.grid.cell
        return self._ground.distances_to(goal, obstacles, least)

    def _path(self, task: Task, node: int, number: int) -> Path:
        """Return the path from the root to a node, and on from there by a word."""
        nodes = self._tree.nodes
        x, y, heading = (float(nodes[node][name]) for name in ("x", "y", "heading"))
        word = word_between(number, Pose(x, y, heading), task.goal, task.footprint.radius)
        pieces = [
            (turn / word.radius, way)
            for turn, way in zip(word.turns, word.ways, strict=True)
            if abs(way) > LEAST_PIECE
        ]
        while node != NONE:
            pieces.insert(0, (float(nodes[node].curvature), float(nodes[node].way)))
            node = int(nodes[node].parent)
        return path_of(task.root, np.array(pieces))


def disc_around_axle(footprint: Footprint) -> float:
    """Return the radius [m] of the largest disc around the rear axle's middle inside of the box."""
    return min(footprint.half_width, footprint.half_length - abs(footprint.middle))
