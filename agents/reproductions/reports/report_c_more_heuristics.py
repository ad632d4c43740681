"""Report on an articulated vehicle: the heuristics that it asks for next, and more."""

from race_agents.reproductions.plan import Reproduction
from race_agents.reproductions.report_c import (
    ASSUMPTIONS,
    COLUMNS,
    EXAM,
    FULL,
    PARKED,
    PRESET,
    QUICK,
    SOURCE,
    with_heuristic,
)

REPRODUCTION = Reproduction(
    title="A lorry learns to park: heuristics that know its turning, its trailer, or more of walls",
    source=f"{SOURCE}: asked for, not tried",
    preset=PRESET,
    rows=(
        with_heuristic("bfs", "the best of three"),
        with_heuristic("grid", "Dijkstra and A*: asked for"),
        with_heuristic("reeds-shepp", "non-holonomic: asked for"),
        with_heuristic("hybrid", "–"),
        with_heuristic("trailer-car", "–"),
        with_heuristic("privileged", "privileged coordinates: asked for"),
    ),
    exam=EXAM,
    full=FULL,
    quick=QUICK,
    their_heads=("finding",),
    columns=COLUMNS,
    plotted=PARKED,
    base="bfs",
    assumptions=(
        *ASSUMPTIONS,
        "A* to one fixed goal gives the same distances as Dijkstra's algorithm, so `grid` is both.",
    ),
)
