"""List all policies with their origin and their figures."""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from race_agents.policies.registry import (
    CONFIG,
    EVALUATION,
    SHIPPED,
    name_of,
    policies_of_runs,
)
from race_agents.policies.session import Policy
from race_server.errors import DriverError
from race_server.scenario.text_files import MOST_TOML, parse_toml, read_text

UNKNOWN = "–"
TRACK_FIGURES = ("speed", "crash_rate", "laps", "best_lap_s", "reward")
LOT_FIGURES = ("success_rate", "aligned_rate", "collisions", "hit_people", "episodes", "reward")


@dataclass(frozen=True)
class PolicyEntry:
    """One policy."""

    name: str  # behind `learned:`
    file: str
    is_run: bool  # else it is bundled with this program
    preset: str = UNKNOWN  # its title
    vehicle: str = UNKNOWN
    more_vehicles: tuple[str, ...] = ()  # with which it learned as well
    algorithm: str = UNKNOWN
    tracks: tuple[str, ...] = ()  # that it learned on
    lots: tuple[str, ...] = ()  # the same of a policy that parks
    evaluation: dict[str, Any] = field(default_factory=dict)  # means over all unseen courses
    remark: str = ""  # why it cannot be loaded


def entries() -> list[PolicyEntry]:
    """Return the bundled policies, and those of the user's runs."""
    shipped = [
        _entry(path.stem, path, path.with_suffix(".json"), path.stem, is_run=False)
        for path in sorted(SHIPPED.glob("*.onnx"))
    ]
    runs = [
        _entry(name_of(path.parent), path, path.with_name(EVALUATION), _title(path), is_run=True)
        for path in policies_of_runs()
    ]
    return [*shipped, *runs]


def _entry(name: str, path: Path, evaluation: Path, preset: str, *, is_run: bool) -> PolicyEntry:
    try:
        metadata = Policy(path).metadata
    except DriverError as error:
        return PolicyEntry(name, str(path), is_run, preset, remark=str(error))
    return PolicyEntry(
        name=name,
        file=str(path),
        is_run=is_run,
        preset=preset,
        vehicle=metadata.vehicle,
        more_vehicles=metadata.more_vehicles,
        algorithm=metadata.algorithm,
        tracks=metadata.tracks,
        lots=metadata.lots,
        evaluation=_evaluation(evaluation),
    )


def _title(policy: Path) -> str:
    """Return the title of the preset of a run."""
    try:
        words = parse_toml(read_text(policy.with_name(CONFIG), MOST_TOML, DriverError))
    except (DriverError, ValueError):
        return UNKNOWN
    return str(words.get("title") or UNKNOWN)


def _evaluation(path: Path) -> dict[str, Any]:
    """Return the figures over all courses; empty if the file has none, or is damaged."""
    try:
        words = json.loads(path.read_text(encoding="utf-8"))
        name, keys = ("lot", LOT_FIGURES) if "lots" in words else ("track", TRACK_FIGURES)
        (row,) = [one for one in words[f"{name}s"] if one[name] == "all"]
        figures = {key: row[key] for key in keys}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return {}
    return figures if all(map(_is_figure, figures.items())) else {}


def _is_figure(item: tuple[str, Any]) -> bool:
    key, value = item
    if value is None:
        return key == "best_lap_s"
    return isinstance(value, int | float) and math.isfinite(value)
