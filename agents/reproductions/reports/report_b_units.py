"""Report of the 1/10 race, 2023, table 5.3: the units of its reward, which it prints without."""

from dataclasses import replace

from race_agents.reproductions.plan import Variant
from race_agents.reproductions.report_b import ASSUMPTIONS
from race_agents.reproductions.reports import report_b_time_trial as table

_BASE = table.REPRODUCTION.rows[0]


def _read_as(name: str, per_metre: float, per_speed: float) -> Variant:
    """Return a reading: what the reward pays for 1 m to what is nearest, and for 1 m/s."""
    weights = f"range = {per_metre}, speed = {per_speed}, crash = -300.0"
    return replace(_BASE, name=name, changes=(f"reward={{{weights}}}",))


REPRODUCTION = replace(
    table.REPRODUCTION,
    title="What units the reward of the 1/10 race has: four readings of its base network",
    rows=(
        _read_as("m and m/s", 12.0, 3.0),
        _read_as("m and km/h", 12.0, 10.8),
        _read_as("share of 12 m and m/s", 1.0, 3.0),
        _read_as("share of 12 m and km/h", 1.0, 10.8),
    ),
    assumptions=ASSUMPTIONS,
)
