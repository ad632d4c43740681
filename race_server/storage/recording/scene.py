"""The race as Foxglove draws it: ``foxglove.SceneUpdate`` in JSON.

The message is described in Foxglove's public documentation (docs.foxglove.dev, SceneUpdate).
Karts and hazards live for a moment and are drawn again; the course stays.
"""

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.net.wire.spectate import SnapshotFrame

Floats = NDArray[np.float64]

SCENE_TICKS = 6  # ten pictures a second
_LIFETIME_NS = 300_000_000
_LINE_LIST = 2
_GREY = (0.35, 0.35, 0.38, 1.0)
_AMBER = (0.95, 0.6, 0.1, 0.9)
# Colours that red-green colour-blind people can distinguish: Okabe and Ito, 2008.
COLOURS = (
    (0.90, 0.62, 0.00), (0.34, 0.71, 0.91), (0.00, 0.62, 0.45), (0.94, 0.89, 0.26),
    (0.00, 0.45, 0.70), (0.84, 0.37, 0.00), (0.80, 0.47, 0.65), (0.60, 0.60, 0.60),
)  # fmt: skip

Json = dict[str, Any]


def course_scene(borders: Floats, at_ns: int) -> bytes:
    """Return the borders of a course, shape (P, 4)."""
    points = [_point(x, y, 0.0) for row in borders.tolist() for x, y in (row[:2], row[2:])]
    lines = {
        "type": _LINE_LIST,
        "pose": _pose(0.0, 0.0, 0.0, 0.0),
        "thickness": 2.0,
        "scale_invariant": True,
        "points": points,
        "color": _colour(_GREY),
        "colors": [],
        "indices": [],
    }
    return _update([_entity("course", at_ns, 0, lines=[lines])])


def karts_scene(
    frame: SnapshotFrame, names: dict[int, str], size: tuple[float, float], at_ns: int
) -> bytes:
    """Return karts and hazards. names: drivers by seat; size: length and width of a kart [m]."""
    length, width = size
    entities = []
    for kart in frame.karts:
        seat, x, y = int(kart["seat"]), float(kart["x"]), float(kart["y"])
        cube = {
            "pose": _pose(x, y, 0.25 * width, float(kart["heading"])),
            "size": {"x": length, "y": width, "z": 0.5 * width},
            "color": _colour((*COLOURS[seat % len(COLOURS)], 1.0)),
        }
        text = {
            "pose": _pose(x, y, 1.5 * width, 0.0),
            "billboard": True,
            "font_size": 12.0,
            "scale_invariant": True,
            "color": _colour((1.0, 1.0, 1.0, 1.0)),
            "text": f"{int(kart['rank'])} {names.get(seat, '')}",
        }
        entities.append(_entity(f"kart {seat}", at_ns, _LIFETIME_NS, cubes=[cube], texts=[text]))
    for number, hazard in enumerate(frame.hazards):
        wide = 2.0 * float(hazard["radius"])
        cylinder = {
            "pose": _pose(float(hazard["x"]), float(hazard["y"]), 0.0, 0.0),
            "size": {"x": wide, "y": wide, "z": 0.02},
            "bottom_scale": 1.0,
            "top_scale": 1.0,
            "color": _colour(_AMBER),
        }
        entities.append(_entity(f"hazard {number}", at_ns, _LIFETIME_NS, cylinders=[cylinder]))
    return _update(entities)


def _update(entities: list[Json]) -> bytes:
    return json.dumps({"deletions": [], "entities": entities}, separators=(",", ":")).encode()


def _entity(name: str, at_ns: int, lifetime_ns: int, **shapes: list[Json]) -> Json:
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": _time(at_ns),
        "frame_id": "map",
        "id": name,
        "lifetime": _time(lifetime_ns),
        "frame_locked": False,
        "metadata": [],
        **{kind: shapes.get(kind, []) for kind in kinds},
    }


def _time(nanoseconds: int) -> Json:
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return {"sec": seconds, "nsec": rest}


def _pose(x: float, y: float, z: float, heading: float) -> Json:
    half = 0.5 * heading
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}
    return {"position": _point(x, y, z), "orientation": turn}


def _point(x: float, y: float, z: float) -> Json:
    return {"x": round(x, 4), "y": round(y, 4), "z": round(z, 4)}


def _colour(rgba: tuple[float, ...]) -> Json:
    return dict(zip("rgba", rgba, strict=True))
