"""A picture of plans: walls, the vehicle on its way, and where it changes its direction."""

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from race_agents.planning.dock_tasks import DockTask
from race_agents.planning.parking_tasks import ParkingTask
from race_agents.planning.path import Path
from race_agents.planning.towed_path import TowedPath, behind
from race_server.core.free_space.footprint import Point, convert
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import ScenarioError
from race_server.pictures import save

_INK, _GREY, _BODY, _AHEAD, _BACK = "#20242a", "#c3c8cf", "#8a94a0", "#1565c0", "#ef6c00"
COLUMNS = 2
# Ways between two drawings of a vehicle [lengths], and between two points of a car's path [m].
BODY_EVERY, SPACING = 0.21, 0.05
# What of a picture lies around walls [m], and to the sides of a slot of a car.
AROUND, ASIDE = 0.8, 13.0


def plot_plans(
    vehicle: Vehicle, shown: Sequence[tuple[ParkingTask | DockTask, Path]], file: FilePath
) -> None:
    """Draw paths, each among the walls of its task.

    Raises:
        ScenarioError: the file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    lines = -(-len(shown) // COLUMNS)
    figure, panels = pyplot.subplots(
        lines, COLUMNS, figsize=(14.0, 4.6 * lines), layout="constrained", squeeze=False
    )
    for panel in panels.flat[len(shown) :]:
        panel.set_axis_off()
    for panel, (task, path) in zip(panels.flat, shown, strict=False):
        _draw(panel, vehicle, task, path)
    try:
        save(figure, file)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{file} cannot be written: {error}") from error
    finally:
        pyplot.close(figure)


def _draw(panel: Any, vehicle: Vehicle, task: ParkingTask | DockTask, path: Path) -> None:
    walls = task.walls()
    for x0, y0, x1, y1 in walls:
        panel.plot([x0, x1], [y0, y1], color=_INK, linewidth=2.0)
    for x, y, cos, sin, length, width in task.boxes():
        panel.fill(*_outline((x, y, np.arctan2(sin, cos)), length, width).T, color=_GREY)
    line, ways = _line(path)
    driven = np.concatenate([[0.0], np.cumsum(np.abs(ways))])
    every = BODY_EVERY * vehicle.length
    drawn = [*np.searchsorted(driven, np.arange(0.0, driven[-1], every)), -1]
    if isinstance(path, TowedPath):
        trailer = vehicle.trailers[0]
        axles = behind(line, path.angles, trailer)
        for x, y, heading in axles[drawn]:
            x, y = (
                x + trailer.box_offset * np.cos(heading),
                y + trailer.box_offset * np.sin(heading),
            )
            box = _outline((x, y, heading), 0.5 * trailer.length, 0.5 * trailer.width)
            panel.plot(*box.T, color=_GREY, linewidth=0.8)
        panel.plot(*axles[:, :2].T, color=_INK, linewidth=0.8, linestyle=":")
    for middle in convert(line[drawn], vehicle, Point.REAR_AXLE, Point.MIDDLE):
        box = _outline(middle, 0.5 * vehicle.length, 0.5 * vehicle.width)
        panel.plot(*box.T, color=_BODY, linewidth=0.8)
    for number, way in enumerate(ways):
        ends = line[number : number + 2]
        panel.plot(ends[:, 0], ends[:, 1], color=_AHEAD if way > 0.0 else _BACK, linewidth=1.6)
    changes = np.flatnonzero(np.diff(np.sign(ways))) + 1
    panel.plot(*line[changes, :2].T, "o", color=_INK, markersize=4.0)
    words = f"{task.name}: {path.length:.1f} m, changes of direction: {path.changes}"
    panel.set_title(words, loc="left", color=_INK)
    panel.set_aspect("equal")
    half = ASIDE if isinstance(task, ParkingTask) else float(np.abs(line[:, 0]).max()) + ASIDE
    ends = walls[:, 1::2]
    panel.set_xlim(-half, half)
    panel.set_ylim(ends.min() - AROUND, ends.max() + AROUND)


def _line(path: Path) -> tuple[Floats, Floats]:
    """Return poses of the rear axle along a path, (S + 1, 3), and the ways between them, (S,)."""
    if isinstance(path, TowedPath):
        return path.poses, path.arcs[:, 1]
    samples = path.sampled(SPACING)
    return samples.poses, samples.ways


def _outline(pose: Any, half_length: float, half_width: float) -> Floats:
    """Return the corners of a box, (5, 2); pose: x [m], y [m], heading [rad] of its middle."""
    x, y, heading = pose
    half = np.array([half_length, half_width])
    corners = half * [(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)]
    cos, sin = np.cos(heading), np.sin(heading)
    return np.asarray(corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y))
