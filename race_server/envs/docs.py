"""Write `docs/observations.md` from the definitions: ``python -m race_server.envs.docs``."""

from collections.abc import Iterable
from math import degrees
from pathlib import Path

from race_server.core.observation import LEARNING_PRESETS, PART_NUMBERS, PARTS, PRESETS, layout_of
from race_server.envs.actions import SLOWEST, SPEED_STEP, STEERING_STEP, discrete_table
from race_server.envs.racing.reward_terms import REWARDS, TERMS
from race_server.envs.reality_gap import FACTORS, RealityGap
from race_server.scenario.sensors import Lidar

TARGET = Path(__file__).parents[2] / "docs" / "observations.md"
COMMAND = "python -m race_server.envs.docs"

_INTRODUCTION = """# Observations, actions, rewards

Written by `{command}` from the definitions in the code; do not edit.

An observation is one vector of float32 in SI units, a preset's parts one behind the other. Index
ranges are those of a lidar of {rays} rays and leave out the last number, as slices do in Python;
with another lidar, `race_server.core.observation.layout_of(preset, rays)` gives them. In the kart's
frame x is ahead and y to the left; the course's frame follows the centre line. A tuple of part
names is an observation as well.
"""

_ACTIONS = """## Actions

- `continuous`, a box of 3: drive from -1 to 1 (throttle above zero; below it brake, or reverse once
  the kart stands), steering from -1 to 1 (left positive, a share of the vehicle's limit), item
  (used above 0.5). A kart that counts as stuck accepts its rescue by itself.
- `report_b`, a box of 2: what is added to the set speed, 0 to 1 for 0 to {speed:g} m/s, and to the
  set angle of the road wheels, -1 to 1 for -{angle:g}° to {angle:g}° (left positive). The set speed
  is at least {slowest:g} m/s.
- `increments`, a box of 2: the same, but the set speed falls as well, -1 to 1 for -{speed:g} to
  {speed:g} m/s.
- `control`, a box of 4: what a driver sends. Steering from -1 to 1 (left positive, a share of the
  vehicle's limit), throttle from -1 to 1 (negative drives in reverse), brake from 0 to 1, and the
  buttons as a number (1 use the item, 2 accept a rescue).
- `discrete`, one of {count}, with drive, steering and item as above:
"""

_REWARDS = """## Rewards

A reward is the sum of terms times their weights. The columns on the right are the tables that have
a name; a mapping from terms to weights is a table as well.
"""

_GAP = """## Reality gap

Each learning kart draws these for every episode, from the ranges in the task's `RealityGap`.
"""


def manual() -> str:
    """Return the text of `docs/observations.md`."""
    chapters = (
        _INTRODUCTION.format(command=COMMAND, rays=Lidar().rays),
        *(_preset_chapter(preset) for preset in (*PRESETS, *LEARNING_PRESETS)),
        _actions_chapter(),
        _rewards_chapter(),
        _gap_chapter(),
    )
    return "\n".join(chapters)


def _preset_chapter(preset: str) -> str:
    layout = layout_of(preset, Lidar().rays)
    rows = []
    for name, place in layout.slices.items():
        part = PARTS[PART_NUMBERS[name]]
        bounds = f"{part.low:.6g} to {part.high:.6g}"
        index = f"{place.start}:{place.stop}"
        rows.append((index, f"`{name}`", part.unit, bounds, part.frame, part.meaning))
    head = ("index", "name", "unit", "range", "frame", "meaning")
    return f"## Preset `{preset}`: {layout.size} numbers\n\n{_table(head, rows)}"


def _actions_chapter() -> str:
    choices = discrete_table()
    rows = [
        (str(number), f"{drive:g}", f"{steering:g}", f"{item:g}")
        for number, (drive, steering, item) in enumerate(choices)
    ]
    text = _ACTIONS.format(
        speed=SPEED_STEP, angle=degrees(STEERING_STEP), slowest=SLOWEST, count=len(choices)
    )
    return f"{text}\n{_table(('action', 'drive', 'steering', 'item'), rows)}"


def _rewards_chapter() -> str:
    tables = list(REWARDS)
    rows = []
    for term, meaning in TERMS.items():
        weights = [
            f"{REWARDS[table][term]:g}" if term in REWARDS[table] else "" for table in tables
        ]
        rows.append((f"`{term}`", meaning, *weights))
    head = ("term", "over one decision", *(f"`{table}`" for table in tables))
    return f"{_REWARDS}\n{_table(head, rows)}"


def _gap_chapter() -> str:
    nominal = RealityGap()
    rows = []
    for name, factor in FACTORS.items():
        low, high = getattr(nominal, name)
        rows.append((f"`{name}`", factor.unit, f"{low:g} to {high:g}", factor.meaning))
    return f"{_GAP}\n{_table(('draw', 'unit', 'default', 'meaning'), rows)}"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    lines = [tuple(head)]
    lines += [("---",) * len(lines[0]), *(tuple(row) for row in rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    TARGET.write_text(manual(), encoding="utf-8")
