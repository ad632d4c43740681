"""Metadata of a policy file: its observations, the meaning of its actions, its training."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, get_args, get_origin

from race_server.core.clock import TICK_S
from race_server.core.observation import PART_NUMBERS, PRESETS
from race_server.envs.actions import ACTIONS, RESIDUAL
from race_server.errors import DriverError
from race_server.scenario.sensors import MOST_RAYS

# Increase it when the meaning of an observation part or of an action changes.
VERSION = 1
KEY = "race-server-policy"  # of the metadata of the ONNX file
DIGEST = "race-server-digest"  # the same, of its network and the metadata above
INPUT, OUTPUT = "observation", "action"
MOST_BITS = 64  # of an integer
MOST_DECISION_S = 10.0
# What files of earlier versions of this program lack, and how they are read.
LATER: Mapping[str, Any] = {
    "base": "",
    "lots": (),
    "level": "",
    "more_vehicles": (),
    "scan_limit": 0.0,
    "evades": False,
    "charts": False,
}
MOST_SCAN_LIMIT = 10.0
# What a kart with a lidar sees only once it has charted its course.
CHARTED = frozenset(PRESETS["rivals"]) - frozenset(PRESETS["lidar"])


@dataclass(frozen=True)
class PolicyMetadata:
    """Metadata of a policy, as stored in its file."""

    parts: tuple[str, ...]  # of the observation, in order
    sizes: tuple[int, ...]  # of the parts
    action: str  # kind of action, see `race_server.envs.actions`
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
    lots: tuple[str, ...] = ()  # on which it learned to park; then there are no tracks
    level: str = ""  # how well it had to park, if not as each lot says
    more_vehicles: tuple[str, ...] = ()  # with which it learned as well
    scan_limit: float = 0.0  # it brakes beyond this share of the speed of `follow_gap`; 0: never
    evades: bool = False  # its commands are changed where they would soon touch something
    charts: bool = False  # it sees the line of a chart that it makes in its first lap
    version: int = VERSION

    @property
    def size(self) -> int:
        """Numbers of an observation."""
        return sum(self.sizes)

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of all vehicles that it learned with."""
        return (self.vehicle, *self.more_vehicles)

    def as_text(self) -> str:
        """Return everything as JSON."""
        return json.dumps(asdict(self))


def digest_of(graph: bytes | memoryview, words: str) -> str:
    """Return a digest of a network, as its file holds it, and of its metadata under KEY."""
    digest = hashlib.sha256(graph)
    digest.update(words.encode())
    return digest.hexdigest()


def metadata_of(metadata: Mapping[str, str], name: str) -> PolicyMetadata:
    """Return the metadata of an ONNX file.

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
    built = _built(words, name)
    _check(built, name)
    return built


def _built(words: dict[str, Any], name: str) -> PolicyMetadata:
    values: dict[str, Any] = {}
    for field in fields(PolicyMetadata):
        value = words.get(field.name, LATER.get(field.name))
        if isinstance(value, list):
            value = tuple(value)
        elif field.type is float and isinstance(value, int):
            value = float(value) if value.bit_length() < MOST_BITS else math.inf
        if not _fits(value, field.type):
            raise DriverError(
                f"{name}: {field.name} = {value!r:.60} in its metadata is not valid; "
                "export it again"
            )
        values[field.name] = value
    return PolicyMetadata(**values)


def _fits(value: Any, wanted: Any) -> bool:
    """Return whether a value is of a type, all members of a tuple included, and finite."""
    if get_origin(wanted) is tuple:
        member = get_args(wanted)[0]
        return isinstance(value, tuple) and all(_fits(one, member) for one in value)
    if wanted is int and isinstance(value, bool):
        return False  # which Python takes for a number
    return isinstance(value, wanted) and (wanted is not float or math.isfinite(value))


def _check(metadata: PolicyMetadata, name: str) -> None:
    unknown = [part for part in metadata.parts if part not in PART_NUMBERS]
    if unknown or not metadata.parts:
        raise DriverError(
            f"{name} observes {unknown or 'nothing'}, which this program does not know; "
            "train it again"
        )
    if metadata.action not in ACTIONS:
        raise DriverError(
            f"{name} answers with actions {metadata.action!r}; known are {', '.join(ACTIONS)}"
        )
    if (ACTIONS[metadata.action] == RESIDUAL) != bool(metadata.base):
        raise DriverError(
            f"{name}: actions {metadata.action!r} and base {metadata.base!r} do not fit; "
            "export it again"
        )
    if ":" in metadata.base:  # such as a policy, which could name itself
        raise DriverError(f"{name}: base {metadata.base!r} takes no advice; export it again")
    if not 0.0 <= metadata.scan_limit <= MOST_SCAN_LIMIT or (
        metadata.scan_limit and ("lidar" not in metadata.parts or metadata.base or metadata.lots)
    ):
        raise DriverError(
            f"{name}: scan_limit = {metadata.scan_limit:g}: it is for policies that race by a "
            f"lidar, without a base driver, from 0 to {MOST_SCAN_LIMIT:g}; export it again"
        )
    if metadata.evades and (metadata.base or not metadata.lots):
        raise DriverError(
            f"{name}: evades = true: it is for policies that park, without a base driver; export "
            "it again"
        )
    sees_line = not CHARTED.isdisjoint(metadata.parts)
    if metadata.charts and (
        metadata.base or metadata.lots or "lidar" not in metadata.parts or not sees_line
    ):
        raise DriverError(
            f"{name}: charts = true: it is for policies that race by a lidar and a line, without a "
            "base driver; export it again"
        )
    if not TICK_S <= metadata.decision_s <= MOST_DECISION_S:
        raise DriverError(f"{name} decides every {metadata.decision_s:g} s; export it again")
    if not 0 <= metadata.lidar_rays <= MOST_RAYS:
        raise DriverError(
            f"{name} observes {metadata.lidar_rays} rays, at most {MOST_RAYS} are possible; "
            "export it again"
        )
    sizes_fit = len(metadata.sizes) == len(metadata.parts)
    if not sizes_fit or not all(size > 0 for size in metadata.sizes):
        raise DriverError(
            f"{name}: {len(metadata.parts)} parts of sizes {metadata.sizes!s:.60} do not fit"
        )


def preset_for(metadata: PolicyMetadata, name: str, more: tuple[str, ...] = ()) -> str:
    """Return the smallest preset of a live race with all parts that a policy observes.

    more: parts that its base driver observes. What its chart shows needs no preset.

    Raises:
        DriverError: there is none.
    """
    wanted = {*metadata.parts, *more} - (CHARTED if metadata.charts else set())
    fitting = [preset for preset, parts in PRESETS.items() if wanted <= set(parts)]
    if not fitting:
        raise DriverError(f"{name} observes {', '.join(metadata.parts)}: no preset has them all")
    return min(fitting, key=lambda preset: len(PRESETS[preset]))
