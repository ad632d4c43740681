"""Report on an articulated vehicle: the heuristics that it asks for next, and more."""

from race_agents.reproductions.report_c import heuristics_table_of, with_heuristic

REPRODUCTION = heuristics_table_of(
    "A lorry learns to park: heuristics that know its turning, its trailer, or more of walls",
    with_heuristic("bfs", "the best of three"),
    with_heuristic("grid", "Dijkstra and A*: asked for"),
    with_heuristic("reeds-shepp", "non-holonomic: asked for"),
    with_heuristic("hybrid", "–"),
    with_heuristic("trailer-car", "–"),
    with_heuristic("privileged", "privileged coordinates: asked for"),
    with_heuristic("cost-to-go", "–"),
    finding="asked for, not tried",
    base="bfs",
    assumptions=(
        "A* to one fixed goal gives the same distances as Dijkstra's algorithm, so `grid` is both.",
    ),
)
