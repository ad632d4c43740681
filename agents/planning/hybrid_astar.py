"""Hybrid A*: a search over arcs, one state for each cell of place, heading and direction.

Dolgov, Thrun, Montemerlo and Diebel, Path planning for autonomous vehicles in unknown semi-
structured environments, International Journal of Robotics Research 29(5), 2010. States are poses of
the rear axle, not cells; from some of them the rest of the path is tried as one word of Reeds and
Shepp. The estimate of what is left is the longer of the way around obstacles and the shortest path
of a car without them.

The search begins at the narrower end: what leads out of a slot are few states, what leads towards
it are many. A path driven back is a path.
"""

import math
from typing import NamedTuple

from race_agents.planning.analytic_expansion import (
    CUSP,
    NO_WORD,
    Prices,
    cheapest_free_word,
    cost_of_way,
)
from race_agents.planning.footprint import Footprint
from race_agents.planning.obstacles import Obstacles, free_way
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
from race_server.core.kernels.distance_field import distance_at
from race_server.core.kernels.geometry import TURN, Pose, along_arc, seen_from
from race_server.core.kernels.jit import large_kernel
from race_server.core.kernels.reeds_shepp import least_cost
from race_server.core.state import Floats

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


@large_kernel
def cell_of(root: Pose, mesh: Mesh, pose: Pose, direction: float) -> int:
    """Return the number of the cell of a pose and a direction, in the frame of the root."""
    seen = seen_from(root, pose)
    along = math.floor(seen.x / mesh.along + 0.5) & 0xFFFFF
    across = math.floor(seen.y / mesh.across + 0.5) & 0xFFFFF
    turns = math.floor(TURN / mesh.turn + 0.5)
    turn = math.floor((seen.heading + math.pi) / mesh.turn + 0.5) % turns
    way = 1 if direction > 0.0 else 0
    return (((along << 20) | across) << 16 | turn) << 1 | way


@large_kernel
def estimate(task: Task, pose: Pose) -> float:
    """Return an estimate [m] of the cost from a pose to the goal; infinite if it is cut off."""
    field = distance_at(task.obstacles.grid, task.distances, pose.x, pose.y)
    if field == math.inf:
        return math.inf
    drive = least_cost(pose, task.goal, task.footprint.radius, CUSP)
    return task.mesh.greed * max(field, drive)


@large_kernel
def add_root(task: Task, tree: Tree) -> None:
    """Begin the tree."""
    clear_tree(tree)
    node = draft(tree)
    node.x, node.y, node.heading = task.root.x, task.root.y, task.root.heading
    node.curvature = node.way = node.cost = 0.0
    node.parent, node.cell = NONE, cell_of(task.root, task.mesh, task.root, 0.0)
    node.estimate = estimate(task, task.root)
    keep_draft(tree)


@large_kernel
def expand(task: Task, tree: Tree, number: int) -> None:
    """Add what can be reached from a node by one arc."""
    mesh, parent = task.mesh, tree.nodes[number]
    start = Pose(parent.x, parent.y, parent.heading)
    for choice in range(2 * len(CURVATURES)):
        direction = 1.0 if choice & 1 else -1.0
        curvature = CURVATURES[choice >> 1] / task.footprint.radius
        way = free_way(task.obstacles, task.footprint, start, curvature, direction * mesh.step)
        if abs(way) < mesh.least:
            continue
        pose, node = along_arc(start, curvature, way), draft(tree)
        node.cost = parent.cost + cost_of_way(way, task.prices)
        node.cost += CUSP if direction * parent.way < 0.0 else 0.0
        left = estimate(task, pose)
        if left == math.inf:
            continue
        node.x, node.y, node.heading = pose
        node.curvature, node.way, node.parent = curvature, way, number
        node.estimate = node.cost + left
        node.cell = cell_of(task.root, mesh, pose, direction)
        keep_draft(tree)


@large_kernel
def search(task: Task, tree: Tree) -> tuple[int, int]:
    """Return the node from which a word leads to the goal, and the word's number.

    The node is EXHAUSTED or GAVE_UP if there is none.
    """
    add_root(task, tree)
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
            pose, left = Pose(node.x, node.y, node.heading), least - node.cost
            word, cost = cheapest_free_word(
                task.obstacles,
                task.footprint,
                pose,
                task.goal,
                node.way,
                left,
                task.prices,
                task.costs,
            )
            if word != NO_WORD:
                found, found_word, least = number, word, node.cost + cost
                most_nodes = min(most_nodes, int(SECOND_LOOK * tree.counts[NODES]) + SPARE)
            wait = (node.estimate - node.cost) / (task.mesh.greed * PATIENCE)
        if tree.counts[NODES] + 2 * len(CURVATURES) > most_nodes:
            return (GAVE_UP if found == EXHAUSTED else found), found_word
        expand(task, tree, number)
