"""A picture of plans: walls, the vehicle on its way, and where it changes its direction."""

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from race_agents.planning.footprint import Point
from race_agents.planning.parking_tasks import ParkingTask
from race_agents.planning.path import Path
from race_server.core.vehicles import Vehicle
from race_server.errors import ScenarioError
from race_server.pictures import save

_INK, _GREY, _AHEAD, _BACK = "#20242a", "#c3c8cf", "#1565c0", "#ef6c00"
COLUMNS = 2
# Way between two drawings of the vehicle, and between two points of its path [m].
BODY_EVERY, SPACING = 1.0, 0.05


def plot_plans(vehicle: Vehicle, shown: Sequence[tuple[ParkingTask, Path]], file: FilePath) -> None:
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


def _draw(panel: Any, vehicle: Vehicle, task: ParkingTask, path: Path) -> None:
    for x0, y0, x1, y1 in task.walls():
        panel.plot([x0, x1], [y0, y1], color=_INK, linewidth=2.0)
    samples = path.sampled(SPACING)
    driven = np.concatenate([[0.0], np.cumsum(np.abs(samples.ways))])
    drawn = np.searchsorted(driven, np.arange(0.0, driven[-1], BODY_EVERY))
    for x, y, heading in samples.of(vehicle, Point.MIDDLE)[[*drawn, -1]]:
        half = 0.5 * np.array([vehicle.length, vehicle.width])
        corners = half * [(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)]
        cos, sin = np.cos(heading), np.sin(heading)
        outline = corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
        panel.plot(*outline.T, color=_GREY, linewidth=0.8)
    for number, way in enumerate(samples.ways):
        ends = samples.poses[number : number + 2]
        panel.plot(ends[:, 0], ends[:, 1], color=_AHEAD if way > 0.0 else _BACK, linewidth=1.6)
    changes = np.flatnonzero(np.diff(np.sign(samples.ways))) + 1
    panel.plot(*samples.poses[changes, :2].T, "o", color=_INK, markersize=4.0)
    words = f"{task.name}: {path.length:.1f} m, changes of direction: {path.changes}"
    panel.set_title(words, loc="left", color=_INK)
    panel.set_aspect("equal")
    panel.set_xlim(-13.0, 13.0)
    panel.set_ylim(-task.depth - 0.8, task.aisle + 0.8)
