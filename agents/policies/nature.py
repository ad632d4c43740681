"""What a policy's file says of itself: what it sees, what its answers mean, where it learned."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from race_server.env.actions import ACTIONS, RESIDUAL
from race_server.errors import DriverError
from race_server.observe import PART_NUMBERS, PRESETS

# Raise it when a part of an observation or a kind of action comes to mean something else.
VERSION = 1
KEY = "race-server-policy"  # of the metadata of the ONNX file
INPUT, OUTPUT = "observation", "action"


@dataclass(frozen=True)
class Nature:
    """What a policy is, as its file tells it."""

    parts: tuple[str, ...]  # of the observation, in order
    sizes: tuple[int, ...]  # of the parts
    action: str  # kind of action, see `race_server.env.actions`
    vehicle: str
    lidar_rays: int  # 0: it needs no lidar
    lidar_field: float  # [rad]
    lidar_reach: float  # [m]
    decision_s: float
    algorithm: str
    tracks: tuple[str, ...]  # on which it learned
    seed: int
    settings: str  # digest of all settings of the training
    simulator: str  # version of this program
    base: str = ""  # the driver that residual actions advise
    version: int = VERSION

    @property
    def size(self) -> int:
        """Numbers of an observation."""
        return sum(self.sizes)

    def as_text(self) -> str:
        """Return everything as JSON."""
        return json.dumps(asdict(self))


def nature_of(metadata: Mapping[str, str], name: str) -> Nature:
    """Return what the metadata of an ONNX file say.

    Raises:
        DriverError: the file is no policy of this program, of another version, or damaged.
    """
    if KEY not in metadata:
        raise DriverError(
            f"{name} is no policy of this program: its metadata lack {KEY!r}; "
            "make one with `race train`"
        )
    try:
        words = json.loads(metadata[KEY])
        version = words["version"]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise DriverError(f"{name}: the metadata {KEY!r} are damaged; export it again") from error
    if version != VERSION:
        raise DriverError(
            f"{name} is a policy of version {version!r}, this program drives version {VERSION}; "
            "train or export it again"
        )
    nature = _built(words, name)
    _check(nature, name)
    return nature


def _built(words: dict[str, Any], name: str) -> Nature:
    values: dict[str, Any] = {}
    for field in fields(Nature):
        value = words.get(field.name, "" if field.name == "base" else None)
        if isinstance(value, list):
            value = tuple(value)
        elif field.type is float and isinstance(value, int):
            value = float(value)
        wanted = tuple if "tuple" in str(field.type) else field.type
        if not isinstance(value, wanted):  # type: ignore[arg-type]  # a type, not its name
            raise DriverError(f"{name}: {field.name} = {value!r} in its metadata makes no policy")
        values[field.name] = value
    return Nature(**values)


def _check(nature: Nature, name: str) -> None:
    unknown = [part for part in nature.parts if part not in PART_NUMBERS]
    if unknown or not nature.parts:
        raise DriverError(
            f"{name} wants to see {unknown or 'nothing'}, which this program does not know; "
            "train it again"
        )
    if nature.action not in ACTIONS:
        raise DriverError(
            f"{name} answers with actions {nature.action!r}; known are {', '.join(ACTIONS)}"
        )
    if (ACTIONS[nature.action] == RESIDUAL) != bool(nature.base):
        raise DriverError(
            f"{name}: actions {nature.action!r} and base {nature.base!r} do not fit; export it again"
        )
    sizes_fit = len(nature.sizes) == len(nature.parts)
    if not sizes_fit or not all(isinstance(size, int) and size > 0 for size in nature.sizes):
        raise DriverError(f"{name}: {len(nature.parts)} parts of sizes {nature.sizes} do not fit")


def preset_for(nature: Nature, name: str, more: tuple[str, ...] = ()) -> str:
    """Return the smallest observation of a live race that holds all that a policy sees.

    more: parts that the driver sees which it advises.

    Raises:
        DriverError: there is none.
    """
    wanted = {*nature.parts, *more}
    fitting = [preset for preset, parts in PRESETS.items() if wanted <= set(parts)]
    if not fitting:
        raise DriverError(f"{name} sees {', '.join(nature.parts)}: no observation holds them all")
    return min(fitting, key=lambda preset: len(PRESETS[preset]))
