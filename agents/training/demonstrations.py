"""Demonstrations: observations and controls of a driver, in a file that is safe to read.

An .npz of plain arrays: `observations` (n, size) with the parts that `about` names, `controls`
(n, 4) steering, throttle, brake, buttons, and `about`, a JSON text. A policy selects its parts from
the observations, as in a race.
"""

import json
import math
import zipfile
import zlib
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.policies.places import places_in
from race_agents.training.export import metadata_from
from race_agents.training.settings import Settings
from race_agents.training.teacher import actions_of
from race_server.core.clock import TICK_S
from race_server.core.observation import layout_of
from race_server.envs.actions import BRAKED, CONTINUOUS, CONTROL, PEDAL, action_kind
from race_server.errors import RaceError, RecordingError, ScenarioError
from race_server.kept_file import write_file
from race_server.storage.arrays import read_arrays

# Increase it when the meaning of an observation part or of a control changes.
VERSION = 1
MOST_BYTES = 1 << 32  # of all arrays, when they are unpacked
ROUNDING = 1e-6  # of intervals
Rows = NDArray[np.float32]
# Errors of NumPy and of unpacking on a damaged or foreign file.
DAMAGES = (
    *(OSError, ValueError, TypeError, KeyError, EOFError, MemoryError, NotImplementedError),
    *(AttributeError, RecursionError, zipfile.BadZipFile, zlib.error),
)


@dataclass(frozen=True)
class About:
    """Origin of demonstrations."""

    driver: str
    tracks: tuple[str, ...]
    vehicle: str
    parts: tuple[str, ...]  # of an observation, in order
    lidar_rays: int
    lidar_field: float  # [rad]
    lidar_reach: float  # [m]
    decision_s: float
    version: int = VERSION


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """Observations and controls of a driver."""

    about: About
    observations: Rows  # (n, size)
    controls: Rows  # (n, 4)


def write_demonstrations(path: Path, shown: Demonstrations) -> None:
    """Write a file.

    Raises:
        RecordingError: it cannot be written.
    """
    about = np.array(json.dumps(asdict(shown.about)))
    try:
        write_file(
            path,
            lambda file: np.savez_compressed(
                file,
                allow_pickle=False,
                observations=shown.observations,
                controls=shown.controls,
                about=about,
            ),
        )
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror}") from error


def read_demonstrations(path: Path) -> Demonstrations:
    """Return the content of a file.

    Raises:
        RecordingError: it is missing, damaged, or of another version.
    """
    try:
        tables = read_arrays(path, MOST_BYTES)
        words = json.loads(str(tables["about"]))
        observations, controls = tables["observations"], tables["controls"]
    except FileNotFoundError as error:
        raise RecordingError(f"{path}: no such file; record one with `race demonstrate`") from error
    except DAMAGES as error:
        raise RecordingError(
            f"{path}: damaged, or no demonstrations ({error}); record some with `race demonstrate`"
        ) from error
    shown = Demonstrations(_about(words, path), observations, controls)
    _check(shown, path)
    return shown


def _about(words: Any, path: Path) -> About:
    if not isinstance(words, dict) or words.get("version") != VERSION:
        version = words.get("version") if isinstance(words, dict) else None
        raise RecordingError(
            f"{path}: demonstrations of version {version!r}, this program reads version {VERSION}; "
            "record them again"
        )
    values: dict[str, Any] = {}
    for field in fields(About):
        value = words.get(field.name)
        value = tuple(map(str, value)) if isinstance(value, list) else value
        kind: Any = tuple if "tuple" in str(field.type) else field.type
        if not isinstance(value, kind):
            raise RecordingError(f"{path}: {field.name} = {value!r} is not valid")
        values[field.name] = value
    return About(**values)


def _check(shown: Demonstrations, path: Path) -> None:
    try:
        size = layout_of(shown.about.parts, shown.about.lidar_rays).size
    except ScenarioError as error:
        raise RecordingError(f"{path}: {error}") from error
    least = {"decision_s": TICK_S - ROUNDING, "lidar_field": 0.0, "lidar_reach": 0.0}
    for name, number in least.items():
        if not number <= getattr(shown.about, name) < math.inf:
            raise RecordingError(f"{path}: {name} = {getattr(shown.about, name)!r} is not valid")
    seen, controls = shown.observations, shown.controls
    count = len(seen) if seen.ndim else 0
    if count < 1 or seen.shape != (count, size) or controls.shape != (count, 4):
        raise RecordingError(
            f"{path}: observations {seen.shape} and controls {controls.shape}: expected "
            f"(n, {size}) and (n, 4), n above zero"
        )
    for name, rows in (("observations", seen), ("controls", controls)):
        if rows.dtype != np.float32 or not np.isfinite(rows).all():
            raise RecordingError(f"{path}: {name} hold {rows.dtype} or no numbers; record it again")


def pairs_for(settings: Settings, path: Path) -> tuple[Rows, Rows]:
    """Return observations (n, size) and actions (n, A) of demonstrations for a learner.

    Of a driver that decided n times as often as the learner, as in a session of a car park, every
    n-th pair is taken.

    Raises:
        RaceError: the file is damaged, or recorded with another vehicle, interval or lidar.
    """
    shown = read_demonstrations(path)
    about, metadata = shown.about, metadata_from(settings, ())
    if about.vehicle != metadata.vehicle:
        raise ScenarioError(
            f"{path}: vehicle = {about.vehicle!r}, the training's is {metadata.vehicle!r}; record "
            "others"
        )
    ratio = metadata.decision_s / about.decision_s
    every = round(ratio)
    if every < 1 or abs(ratio - every) > ROUNDING:
        raise ScenarioError(
            f"{path}: decision_s = {about.decision_s!r}, the training's is "
            f"{metadata.decision_s!r}, which is no whole multiple of it; record others"
        )
    kind = action_kind(settings.action)
    if kind not in {CONTINUOUS, CONTROL, PEDAL, BRAKED}:
        raise ScenarioError(
            f"action = {settings.action!r}: demonstrations have pedals and steering; choose "
            "'continuous' or 'control', or in a lot 'park' or 'report_a'"
        )
    try:
        layout = layout_of(about.parts, about.lidar_rays)
        gear = np.array([about.lidar_field, about.lidar_reach, about.decision_s])
        places = places_in(layout, metadata, gear, "the learner")
    except RaceError as error:
        raise ScenarioError(f"{path}: {error}") from error
    if "speed" not in layout.slices:
        raise ScenarioError(f"{path}: shows no 'speed', by which a pedal brakes; record others")
    seen, controls = shown.observations[::every], shown.controls[::every]
    controls = np.clip(controls, (-1.0, -1.0, 0.0, 0.0), (1.0, 1.0, 1.0, 3.0))
    speeds = seen[:, layout.slices["speed"].start]
    actions = actions_of(controls.astype(np.float64), kind, speeds.astype(np.float64))
    return np.ascontiguousarray(seen[:, places]), actions
