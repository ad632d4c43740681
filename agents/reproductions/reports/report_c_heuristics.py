"""Report on an articulated vehicle: three heuristics in its shaped reward."""

from race_agents.reproductions.report_c import (
    PPO,
    PPO_ASSUMPTION,
    PPO_FULL,
    PPO_QUICK,
    table_of,
    with_heuristic,
)

REPRODUCTION = table_of(
    "A lorry learns to park: no heuristic, the straight distance, breadth-first search",
    with_heuristic("none", "survives, never arrives"),
    with_heuristic("euclid", "later and lower; only where nothing stands between"),
    with_heuristic("bfs", "best in return, success and length"),
    changes=PPO,
    finding="three curves without numbers",
    base="none",
    assumptions=(PPO_ASSUMPTION,),
    full=PPO_FULL,
    quick=PPO_QUICK,
)
