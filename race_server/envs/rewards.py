"""Rewards: named terms, and tables that weigh them."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from race_server.core.state import Floats
from race_server.errors import ScenarioError

# What each term measures over one decision of one kart. The order is that of the numbers in
# `envs/reward_terms.py`; a test holds the two together.
TERMS: Mapping[str, str] = MappingProxyType(
    {
        "progress": "distance gained along the centre line [m]",
        "speed": "forward speed [m/s]",
        "range": "nearest lidar range [m]",
        "crash": "1 if the kart crashed and is out",
        "contact": "contacts with other karts that began",
        "wall": "contacts with walls that began",
        "wrong_way": "1 while driving the wrong way",
        "off_track": "1 while off the track",
        "places": "places gained",
        "item": "items used",
        "lap": "laps completed",
        "finish": "1 if the kart finished its race",
        "time": "1, always",
        # Report of the 1/10 race, 2024: -300 at a crash, else 12 times the nearest range [m] plus
        # 3 times the speed [m/s].
        "report_b": "12 · nearest range + 3 · speed, or -300 at a crash",
        "lead": "gain in the sum over all rivals of how far ahead of them the kart is, each from "
        "-1 to 1: by distance while both race, half of it at 10 lengths, then by place; only "
        "measured where it has a weight",
    }
)

REWARDS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "progress": {"progress": 1.0, "wall": -0.5, "crash": -1.0, "wrong_way": -0.5},
        "race": {
            "progress": 1.0,
            "places": 1.0,
            "contact": -0.3,
            "wall": -0.5,
            "crash": -10.0,
            "wrong_way": -0.5,
            "off_track": -0.2,
            "finish": 10.0,
        },
        "report_b": {"report_b": 1.0},
    }
)


def reward_weights(table: str | Mapping[str, float]) -> Floats:
    """Return the weight of every term, shape (terms,).

    Raises:
        ScenarioError: no such table or term.
    """
    if isinstance(table, str):
        if table not in REWARDS:
            known = ", ".join(REWARDS)
            raise ScenarioError(f"reward {table!r} is unknown; choose one of {known}")
        table = REWARDS[table]
    unknown = sorted(set(table) - set(TERMS))
    if unknown:
        raise ScenarioError(
            f"reward term {unknown[0]!r} is unknown; choose from {', '.join(TERMS)}"
        )
    return np.array([float(table.get(name, 0.0)) for name in TERMS])
