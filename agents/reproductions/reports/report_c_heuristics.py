"""Report on an articulated vehicle: three heuristics in its shaped reward."""

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
    title="A lorry learns to park: no heuristic, the straight distance, breadth-first search",
    source=f"{SOURCE}: three curves without numbers",
    preset=PRESET,
    rows=(
        with_heuristic("none", "survives, never arrives"),
        with_heuristic("euclid", "later and lower; only where nothing stands between"),
        with_heuristic("bfs", "best in return, success and length"),
    ),
    exam=EXAM,
    full=FULL,
    quick=QUICK,
    their_heads=("finding",),
    columns=COLUMNS,
    plotted=PARKED,
    base="none",
    assumptions=ASSUMPTIONS,
)
