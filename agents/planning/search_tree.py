"""The states that a search has found, the queue of those to expand, and the table of their cells.

Nodes are numbered in the order in which they are found. The queue is a binary heap; of two nodes
with the same estimate the older one goes first, so that a search repeats to the bit. Cells are
found through a hash table with linear probing.
"""

from typing import NamedTuple

import numpy as np

from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rng import mix
from race_server.core.state import Ints, Record, Records

NODE = np.dtype(
    (
        np.record,
        [
            # [m], [rad] of the rear axle, or of the trailer's axle where there is a trailer
            *((name, np.float64) for name in ("x", "y", "heading")),
            ("angle", np.float64),  # [rad] at the hitch, 0 without a trailer
            ("curvature", np.float64),  # [1/m] of the arc that leads here, at its end
            ("wanted", np.float64),  # [rad] towards which the angle went on the way here
            ("way", np.float64),  # [m] on the way here, negative in reverse
            ("cost", np.float64),  # [m] from the root
            ("estimate", np.float64),  # [m] of the whole path
            ("parent", np.int64),  # number of the node before, -1 at the root
            ("cell", np.int64),
        ],
    )
)

# Places in `counts`.
NODES, QUEUED, STEPS = 0, 1, 2
NONE = -1


class Tree(NamedTuple):
    """Nodes, queue and table, all work space."""

    nodes: Records  # (N,) NODE
    queue: Ints  # (N,) numbers of nodes
    table: Ints  # (2^k,) numbers of nodes, NONE where free
    # (3,) nodes found, nodes queued; steps taken, which the next search counts on.
    counts: Ints


def make_tree(nodes: int) -> Tree:
    """Return room for a number of nodes."""
    slots = 1 << (2 * nodes - 1).bit_length()
    return Tree(
        np.zeros(nodes, NODE),
        np.zeros(nodes, np.int64),
        np.full(slots, NONE, np.int64),
        np.zeros(3, np.int64),
    )


@kernel
def clear_tree(tree: Tree) -> None:
    """Forget all nodes, but not how many steps were taken."""
    for slot in range(len(tree.table)):
        tree.table[slot] = NONE
    tree.counts[NODES] = tree.counts[QUEUED] = 0


@kernel
def slot_of(tree: Tree, cell: int) -> int:
    """Return the place in the table of a cell, or where it belongs."""
    mask = len(tree.table) - 1
    slot = int(mix(np.uint64(cell))) & mask
    while tree.table[slot] != NONE and tree.nodes[tree.table[slot]].cell != cell:
        slot = (slot + 1) & mask
    return slot


@kernel
def _is_before(tree: Tree, node: int, other: int) -> bool:
    mine, theirs = tree.nodes[node].estimate, tree.nodes[other].estimate
    return mine < theirs or (mine == theirs and node < other)


@large_kernel
def enqueue(tree: Tree, node: int) -> None:
    """Put a node into the queue."""
    queue = tree.queue
    place = tree.counts[QUEUED]
    tree.counts[QUEUED] += 1
    while place > 0 and _is_before(tree, node, queue[(place - 1) >> 1]):
        queue[place] = queue[(place - 1) >> 1]
        place = (place - 1) >> 1
    queue[place] = node


@large_kernel
def dequeue(tree: Tree) -> int:
    """Return the node with the least estimate, and take it out of the queue, which is not empty."""
    queue = tree.queue
    first = queue[0]
    tree.counts[QUEUED] -= 1
    count = tree.counts[QUEUED]
    last = queue[count]
    place = 0
    while 2 * place + 1 < count:
        child = 2 * place + 1
        if child + 1 < count and _is_before(tree, queue[child + 1], queue[child]):
            child += 1
        if not _is_before(tree, queue[child], last):
            break
        queue[place] = queue[child]
        place = child
    queue[place] = last
    return first


@kernel
def draft(tree: Tree) -> Record:
    """Return the place of the next node, to be filled before `keep_draft`; there must be room."""
    return tree.nodes[tree.counts[NODES]]


@large_kernel
def keep_draft(tree: Tree) -> None:
    """Make the draft a node and queue it, unless its cell is known at no more cost."""
    number = tree.counts[NODES]
    node = tree.nodes[number]
    slot = slot_of(tree, node.cell)
    known = tree.table[slot]
    if known != NONE and tree.nodes[known].cost <= node.cost:
        return
    tree.counts[NODES] += 1
    tree.table[slot] = number
    enqueue(tree, number)


@kernel
def next_node(tree: Tree) -> int:
    """Return the next node to expand, NONE if there is none."""
    while tree.counts[QUEUED] > 0:
        number = dequeue(tree)
        # A cheaper way to its cell may have been found since.
        if tree.table[slot_of(tree, tree.nodes[number].cell)] == number:
            return number
    return NONE
