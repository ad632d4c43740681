"""Hybrid A*: a search over arcs, one state for each cell of place, heading and direction.

Dolgov, Thrun, Montemerlo and Diebel, Path planning for autonomous vehicles in unknown semi-
structured environments, International Journal of Robotics Research 29(5), 2010. States are poses of
the rear axle, not cells; from some of them the rest of the path is tried as one word of Reeds and
Shepp. The estimate of what is left is the longer of the way around obstacles and the shortest path
of a car without them.

The search begins at the narrower end: what leads out of a slot are few states, what leads towards
it are many. A path driven back is a path.

A vehicle with a trailer is searched for by the same loop. Its states are poses of the trailer's
axle and angles at the hitch, its arcs are the moves of `rig_moves`, and instead of a word the way
into the slot is tried. What it drives ahead it cannot drive back alike: its search begins at the
start. Without a trailer `towing` is None, and the compiler leaves out what is for trailers.
"""

import math
from typing import NamedTuple

from race_agents.planning.analytic_expansion import (
    NO_WORD,
    cheapest_free_word,
)
from race_agents.planning.rig_moves import InLine, direction_in, drive, way_in
from race_agents.planning.search_tree import (
    NODES,
    NONE,
    STEPS,
    Tree,
    clear_tree,
    draft,
    keep_draft,
    next_node,
)
from race_server.core.free_space.footprint import Footprint
from race_server.core.free_space.obstacles import Obstacles, free_way
from race_server.core.free_space.prices import Prices, cost_of_way
from race_server.core.free_space.rig import ANGLES, Rig, Towed
from race_server.core.free_space.towed_ways import TowedWays, towed_way
from race_server.core.kernels.distance_field import distance_at
from race_server.core.kernels.geometry import TURN, Pose, along_arc, seen_from
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.reeds_shepp import least_cost
from race_server.core.state import Floats, Record

# Curvatures that are tried, as shares of the greatest.
CURVATURES = (-1.0, -0.5, 0.0, 0.5, 1.0)
# The rest of the path is tried at every n-th state; n grows by one each time this far [m].
PATIENCE = 2.0
# Once a path is found, a cheaper one is looked for: until the tree is larger by this factor, and by
# this many nodes.
SECOND_LOOK, SPARE = 1.5, 500
# Why a search ended without a path.
EXHAUSTED, GAVE_UP = -1, -2


class Mesh(NamedTuple):
    """How finely a search looks."""

    step: float  # [m] of an arc
    least: float  # [m] of an arc that is cut short by an obstacle; shorter ones are left out
    along: float  # [m] side of a cell along the root's heading
    across: float  # [m]
    turn: float  # [rad]
    hitch: float  # [rad] of the angle at the hitch
    greed: float  # factor on estimates: paths may cost as much more, and are found sooner
    nodes: int  # most states


class Task(NamedTuple):
    """What is to be joined."""

    root: Pose
    goal: Pose
    footprint: Footprint
    obstacles: Obstacles
    distances: Floats  # (rows, columns) [m] from each cell to the goal
    prices: Prices
    costs: Floats  # (len(WORDS),), work space
    mesh: Mesh
    steps: int  # most of all searches of a plan: states expanded, and words tried


class Towing(NamedTuple):
    """What a search needs besides for a vehicle with a trailer."""

    rig: Rig
    start: Towed
    asked: InLine  # at the goal
    ways: TowedWays  # estimates are those costs where they are known
    rows: Floats  # (R, 3), work space of `rig_moves.drive`


@large_kernel
def cell_of(root: Pose, mesh: Mesh, pose: Pose, angle: float, direction: float) -> int:
    """Return the number of the cell of a state and a direction, in the frame of the root."""
    seen = seen_from(root, pose)
    along = math.floor(seen.x / mesh.along + 0.5) & 0xFFFFF
    across = math.floor(seen.y / mesh.across + 0.5) & 0xFFFFF
    turns = math.floor(TURN / mesh.turn + 0.5)
    turn = math.floor((seen.heading + math.pi) / mesh.turn + 0.5) % turns
    hitch = math.floor(angle / mesh.hitch + 0.5) & 0xFF
    way = 1 if direction > 0.0 else 0
    return ((((along << 20) | across) << 12 | turn) << 8 | hitch) << 1 | way


@large_kernel
def estimate(task: Task, towing: Towing | None, pose: Pose, way: float) -> float:
    """Return an estimate [m] of the cost from a pose to the goal; infinite if it is cut off.

    way: on which the vehicle came, negative in reverse, 0 if it stood.
    """
    field = distance_at(task.obstacles.grid, task.distances, pose.x, pose.y)
    if field == math.inf:
        return math.inf
    if towing is not None:
        known = towed_way(towing.ways, task.goal, pose, way)
        if known < math.inf:
            return task.mesh.greed * known
    drive = least_cost(pose, task.goal, task.footprint.radius, task.prices.cusp)
    return task.mesh.greed * max(field, drive)


@large_kernel
def add_root(task: Task, towing: Towing | None, tree: Tree) -> None:
    """Begin the tree."""
    clear_tree(tree)
    node = draft(tree)
    node.x, node.y, node.heading = task.root.x, task.root.y, task.root.heading
    node.angle = node.curvature = node.wanted = node.way = node.cost = 0.0
    if towing is not None:
        node.angle = towing.start.angle
    node.parent, node.cell = NONE, cell_of(task.root, task.mesh, task.root, node.angle, 0.0)
    node.estimate = estimate(task, towing, task.root, 0.0)
    keep_draft(tree)


@kernel
def _move_car(task: Task, parent: Record, node: Record, choice: int, direction: float) -> float:
    """Fill a node with what one arc leads to; return its way [m]."""
    start = Pose(parent.x, parent.y, parent.heading)
    curvature = CURVATURES[choice] / task.footprint.radius
    way = free_way(task.obstacles, task.footprint, start, curvature, direction * task.mesh.step)
    node.x, node.y, node.heading = along_arc(start, curvature, way)
    node.angle, node.curvature, node.wanted = 0.0, curvature, 0.0
    return way


@kernel
def towed_at(node: Record, direction: float) -> Towed:
    """Return how a trailer stands at a node, from which the vehicle drives on in a direction.

    At a stand the wheels turn as far as they must: the curvature is infinite there.
    """
    goes_on = direction * node.way > 0.0
    curvature = node.curvature if goes_on else math.inf
    return Towed(node.x, node.y, node.heading, node.angle, curvature)


@kernel
def _move_rig(
    task: Task, towing: Towing, parent: Record, node: Record, choice: int, direction: float
) -> float:
    """Fill a node with what one move of a vehicle with a trailer leads to; return its way [m]."""
    start, wanted = towed_at(parent, direction), ANGLES[choice] * towing.rig.sharpest
    way = direction * task.mesh.step
    end, way = drive(task.obstacles, towing.rig, start, task.goal, wanted, way, towing.rows)
    node.x, node.y, node.heading, node.angle, node.curvature = end
    node.wanted = wanted
    return way


@large_kernel
def expand(task: Task, towing: Towing | None, tree: Tree, number: int) -> None:
    """Add what can be reached from a node by one arc, or by one move."""
    mesh, parent = task.mesh, tree.nodes[number]
    for choice in range(branches_of(towing)):
        direction, node = 1.0 if choice & 1 else -1.0, draft(tree)
        if towing is None:
            way = _move_car(task, parent, node, choice >> 1, direction)
        else:
            way = _move_rig(task, towing, parent, node, choice >> 1, direction)
        if abs(way) < mesh.least:
            continue
        pose = Pose(node.x, node.y, node.heading)
        node.cost = parent.cost + cost_of_way(way, task.prices)
        node.cost += task.prices.cusp if direction * parent.way < 0.0 else 0.0
        left = estimate(task, towing, pose, way)
        if left == math.inf:
            continue
        node.way, node.parent = way, number
        node.estimate = node.cost + left
        node.cell = cell_of(task.root, mesh, pose, node.angle, direction)
        keep_draft(tree)


@kernel
def branches_of(towing: Towing | None) -> int:
    """Return how many nodes follow one node at most."""
    return 2 * len(CURVATURES) if towing is None else 2 * len(ANGLES)


@large_kernel
def _rest(task: Task, towing: Towing | None, node: Record, most: float) -> tuple[int, float]:
    """Return number and cost [m] of what leads from a node to the goal, NO_WORD if nothing does.

    most: it must cost less [m]. The way of a trailer into a slot has the number 0.
    """
    if towing is None:
        return cheapest_free_word(
            task.obstacles,
            task.footprint,
            Pose(node.x, node.y, node.heading),
            task.goal,
            node.way,
            most,
            task.prices,
            task.costs,
        )
    way = direction_in(task.goal, Pose(node.x, node.y, node.heading))
    start = towed_at(node, way)
    driven = way_in(task.obstacles, towing.rig, start, task.goal, towing.asked, way, towing.rows)
    if abs(driven) == math.inf:
        return NO_WORD, math.inf
    cost = cost_of_way(driven, task.prices)
    cost += task.prices.cusp if way * node.way < 0.0 else 0.0
    return (0 if cost < most else NO_WORD), cost


@large_kernel
def search(task: Task, towing: Towing | None, tree: Tree) -> tuple[int, int]:
    """Return the node from which a word leads to the goal, and the word's number.

    The node is EXHAUSTED or GAVE_UP if there is none.
    """
    add_root(task, towing, tree)
    found, found_word, least, most_nodes = EXHAUSTED, NO_WORD, math.inf, task.mesh.nodes
    wait = 0.0
    while True:
        number = next_node(tree)
        if number == NONE or tree.nodes[number].estimate >= least:
            return found, found_word
        if tree.counts[STEPS] >= task.steps:
            return (GAVE_UP if found == EXHAUSTED else found), found_word
        tree.counts[STEPS] += 1
        node = tree.nodes[number]
        wait -= 1.0
        if wait < 0.0:
            tree.counts[STEPS] += 1
            word, cost = _rest(task, towing, node, least - node.cost)
            if word != NO_WORD:
                found, found_word, least = number, word, node.cost + cost
                most_nodes = min(most_nodes, int(SECOND_LOOK * tree.counts[NODES]) + SPARE)
            # Where a trailer cannot go in is soon seen.
            if towing is None:
                wait = (node.estimate - node.cost) / (task.mesh.greed * PATIENCE)
        if tree.counts[NODES] + branches_of(towing) > most_nodes:
            return (GAVE_UP if found == EXHAUSTED else found), found_word
        expand(task, towing, tree, number)
