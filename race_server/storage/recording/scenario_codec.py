"""A scenario as text and arrays, complete: no track file is needed to drive it again."""

import io
import json
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from race_server.core.level import Level
from race_server.core.rules import edition
from race_server.core.vehicles import vehicle_in
from race_server.errors import RecordingError
from race_server.scenario.race import Occasion, Rules, Scenario
from race_server.scenario.sensors import Lidar, Radar
from race_server.scenario.track.course import Course, Obstacle
from race_server.scenario.track.limits import check_sizes
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.lot import Blocks, Lot, People, Taken, Zone
from race_server.storage.arrays import read_arrays

# Of a course and a line of the largest size, when they are unpacked.
MOST_ARRAY_BYTES = 1 << 26

Arrays = dict[str, Any]


def pack_scenario(scenario: Scenario) -> tuple[str, bytes]:
    """Return a scenario as JSON and as the bytes of an .npz file."""
    arrays: Arrays = {}
    words: dict[str, Any] = {
        "course": _taken_apart(scenario.course, "course", arrays),
        "line": scenario.line and _taken_apart(scenario.line, "line", arrays),
        "karts": scenario.karts,
        "vehicles": [asdict(vehicle) for vehicle in scenario.vehicles],
        "rules": asdict(scenario.rules),
        "lidar": asdict(scenario.lidar),
        "radar": asdict(scenario.radar),
        "fitted": scenario.fitted,
        "seed": scenario.seed,
        "grid_order": scenario.grid_order,
        "level": scenario.level and asdict(scenario.level),
        "occasion": scenario.occasion and asdict(scenario.occasion),
    }
    words["course"]["obstacles"] = [asdict(one) for one in scenario.course.obstacles]
    lot = scenario.course.lot
    words["course"]["lot"] = lot and _lot_taken_apart(lot, arrays)
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return json.dumps(words), file.getvalue()


def _lot_taken_apart(lot: Lot, arrays: Arrays) -> dict[str, Any]:
    """Return the plain fields of a car park, and put its slots into `arrays`."""
    plain = _taken_apart(lot, "lot", arrays)
    plain["zones"] = [asdict(zone) for zone in lot.zones]
    for name in _LOT_TABLES:
        plain[name] = asdict(plain[name])
    return plain


# What a car park has as one table each.
_LOT_TABLES = {"taken": Taken, "blocks": Blocks, "people": People}


def _lot_of(words: dict[str, Any], arrays: Arrays) -> Lot:
    """Return the car park that `_lot_taken_apart` took apart."""
    zones = tuple(Zone(**_with_tuples(zone)) for zone in words.pop("zones"))
    tables = {name: kind(**_with_tuples(words.pop(name))) for name, kind in _LOT_TABLES.items()}
    return Lot(zones=zones, **tables, **_with_tuples(words), **_of("lot", arrays))


def _with_tuples(words: dict[str, Any]) -> dict[str, Any]:
    """Return the same with tuples in place of JSON's lists."""
    return {key: tuple(one) if isinstance(one, list) else one for key, one in words.items()}


def _taken_apart(whole: Any, name: str, arrays: Arrays) -> dict[str, Any]:
    """Return the plain fields of a dataclass, and put its arrays into `arrays`."""
    plain = {}
    for part in fields(whole):
        value = getattr(whole, part.name)
        if isinstance(value, np.ndarray):
            arrays[f"{name}.{part.name}"] = value
        else:
            plain[part.name] = value
    return plain


def unpack_scenario(setting: str, packed: bytes) -> Scenario:
    """Return the scenario that `pack_scenario` packed.

    Raises:
        RecordingError: text or arrays are damaged, or of another version.
    """
    try:
        words = json.loads(setting)
        arrays: Arrays = read_arrays(io.BytesIO(packed), MOST_ARRAY_BYTES)
        course = words["course"]
        course["obstacles"] = tuple(Obstacle(**one) for one in course["obstacles"])
        course["sectors"] = tuple(course["sectors"])
        lot = course.pop("lot", None)
        level, occasion = words.get("level"), words.get("occasion")
        line = words["line"] and ReferenceLine(**words["line"], **_of("line", arrays))
        whole = Course(**course, lot=lot and _lot_of(lot, arrays), **_of("course", arrays))
        check_sizes(whole)
        return Scenario(
            course=whole,
            karts=words["karts"],
            vehicles=tuple(map(vehicle_in, words["vehicles"])),
            rules=Rules(**{"edition": edition.FIRST, **words["rules"]}),
            lidar=Lidar(**words["lidar"]),
            radar=Radar(**words["radar"]),
            fitted=tuple(words["fitted"]),
            seed=words["seed"],
            grid_order=tuple(words["grid_order"]),
            line=line or None,
            level=Level(**level) if level else None,
            occasion=Occasion(**occasion) if occasion else None,
        )
    # Whatever the damage makes json, zip and numpy trip over.
    except Exception as error:
        raise RecordingError(
            f"the race's setting cannot be read ({type(error).__name__}: {error}); it is damaged, "
            "or was recorded by another version of race-server"
        ) from error


def _of(name: str, arrays: Arrays) -> Arrays:
    """Return the arrays of one dataclass by field."""
    prefix = f"{name}."
    return {
        key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)
    }
