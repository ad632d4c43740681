"""Where the numbers that a policy sees lie in what a race shows."""

import numpy as np

from race_agents.policies.metadata import CHARTED, PolicyMetadata
from race_server.core.kernel_driver import FIELD, REACH
from race_server.core.observation import Layout
from race_server.core.state import Float32s, Floats, Ints
from race_server.errors import DriverError

# Lidars that differ by less, in rad or m, are the same.
TOLERANCE = 1e-3


def places_in(layout: Layout, nature: PolicyMetadata, setup: Floats, name: str) -> Ints:
    """Return where each number that a policy sees lies in a larger observation, shape (size,).

    A policy that learned with fewer lidar rays in the same field takes every n-th of them. What
    only its chart shows lies nowhere, at -1, where there is no chart.

    Raises:
        DriverError: a part is missing, or has another size.
    """
    places: list[int] = []
    for part, size in zip(nature.parts, nature.sizes, strict=True):
        if nature.charts and part in CHARTED and part not in layout.slices:
            places += [-1] * size
            continue
        if part not in layout.slices:
            raise DriverError(f"{name} wants to see {part!r}; the race shows {layout.preset!r}")
        there = layout.slices[part]
        offered = there.stop - there.start
        step = 1
        if part in {"lidar", "lidar_before"}:
            _check_lidar(nature, setup, name)
            step = max((offered - 1) // max(size - 1, 1), 1)
        if offered != (size - 1) * step + 1:
            raise DriverError(
                f"{name} learned with {size} numbers of {part!r}, the race shows {offered}; "
                "train it with this many"
            )
        places += range(there.start, there.stop, step)
    return np.array(places, np.int64)


def _check_lidar(nature: PolicyMetadata, setup: Floats, name: str) -> None:
    field, reach = float(setup[FIELD]), float(setup[REACH])
    if abs(field - nature.lidar_field) > TOLERANCE or abs(reach - nature.lidar_reach) > TOLERANCE:
        raise DriverError(
            f"{name} learned with a lidar of {np.degrees(nature.lidar_field):.0f}° and "
            f"{nature.lidar_reach:g} m, this one has {np.degrees(field):.0f}° and {reach:g} m; "
            "train it with this lidar"
        )


def picked(rows: Floats, places: Ints) -> Float32s:
    """Return the numbers (n, size) that a policy sees of observations (n, S).

    places: (size,) as `places_in` returns them; what lies nowhere is 0.
    """
    seen = rows[:, places].astype(np.float32)
    seen[:, places < 0] = 0.0
    return seen
