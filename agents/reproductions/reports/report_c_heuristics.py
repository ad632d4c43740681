"""Report on an articulated vehicle: three heuristics in its shaped reward."""

from race_agents.reproductions.report_c import heuristics_table_of, with_heuristic

REPRODUCTION = heuristics_table_of(
    "A lorry learns to park: no heuristic, the straight distance, breadth-first search",
    with_heuristic("none", "survives, never arrives"),
    with_heuristic("euclid", "later and lower; only where nothing stands between"),
    with_heuristic("bfs", "best in return, success and length"),
    finding="three curves without numbers",
    base="none",
)
