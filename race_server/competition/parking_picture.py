"""A picture of an exam of parking: where it failed, and times beside those of plans."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from race_server.competition.parking_exam import Try
from race_server.core.state import Floats
from race_server.pictures import save_and_close
from race_server.scenario.track.polyline import corners_of_box

_INK, _GREY, _BLUE = "#20242a", "#c3c8cf", "#1565c0"
_COLOURS = {
    "late": "#9e9d24",
    "left": "#6a1b9a",
    "wall": "#d84315",
    "block": "#ef6c00",
    "vehicle": "#ad1457",
    "person": "#c62828",
    "jack_knife": "#00838f",
    "own_body": "#4e342e",
    "driver": "#20242a",
}
_WIDTH, _HEIGHT = 14.0, 4.2  # [in] of one row
_PAD = 0.15  # [in] above and below a row
_BINS = 40
# Seeds of failures that are written, of each kind, and how far apart [share of the site].
_MOST_TOLD, _APART = 8, 0.03


@dataclass(frozen=True, eq=False)
class Drawn:
    """One driver in one scenario."""

    title: str
    tries: Sequence[Try]
    ratios: Sequence[float]  # time of a parked vehicle over that of the plan


def draw_exam(drawn: Sequence[Drawn], path: Path) -> None:
    """Draw a row of two panels for each driver and scenario.

    Raises:
        ScenarioError: the file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    size = (_WIDTH, _HEIGHT * len(drawn))
    figure, panels = pyplot.subplots(
        len(drawn),
        2,
        figsize=size,
        layout=ConstrainedLayoutEngine(h_pad=_PAD),
        squeeze=False,
        width_ratios=(2.2, 1.0),
    )
    for (place, times), one in zip(panels, drawn, strict=True):
        _draw_places(place, one)
        _draw_times(times, one)
    save_and_close(figure, path, dpi=150, facecolor="white")


def _draw_places(panel: Any, drawn: Drawn) -> None:
    """Draw the walls, and where vehicles were when they failed."""
    for x0, y0, x1, y1 in drawn.tries[0].order.walls:
        panel.plot([x0, x1], [y0, y1], color=_INK, linewidth=1.2, zorder=2)
    for slot in dict.fromkeys(one.order.slot for one in drawn.tries):
        loop = corners_of_box(slot.x, slot.y, slot.heading, slot.length, slot.width)
        panel.plot(*loop[[0, 1, 2, 3, 0]].T, color=_GREY, linewidth=0.8, zorder=1)
    starts = np.array([one.start[:2] for one in drawn.tries])
    panel.plot(*starts.T, ".", color=_GREY, markersize=2.0, zorder=1)
    failed = [one for one in drawn.tries if not one.figures["is_success"]]
    for ending, colour in _COLOURS.items():
        places = np.array([one.end[:2] for one in failed if one.figures["ending"] == ending])
        if len(places):
            words = f"{ending}: {len(places)}"
            panel.plot(*places.T, "o", color=colour, markersize=5.0, label=words, zorder=3)
    for one in _told(failed, drawn.tries[0].order.walls):
        panel.annotate(f"{one.seed}", one.end[:2], (3, 3), textcoords="offset points", fontsize=6)
    if failed:
        panel.legend(loc="upper left", bbox_to_anchor=(0.0, -0.05), ncols=7, frameon=False)
    parked = len(drawn.tries) - len(failed)
    panel.set_title(f"{drawn.title}: {parked} of {len(drawn.tries)} parked", loc="left")
    panel.set_aspect("equal")
    _dress(panel)


def _told(failed: Sequence[Try], walls: Floats) -> list[Try]:
    """Return the failures whose seeds are written: not all of many, and none over another."""
    ends = walls.reshape(-1, 2)
    apart = _APART * float(np.hypot(*(ends.max(axis=0) - ends.min(axis=0))))
    told: list[Try] = []
    counts: dict[str, int] = {}
    for one in failed:
        ending = one.figures["ending"]
        is_free = all(np.hypot(*(one.end[:2] - other.end[:2])) > apart for other in told)
        if is_free and counts.get(ending, 0) < _MOST_TOLD:
            counts[ending] = counts.get(ending, 0) + 1
            told.append(one)
    return told


def _draw_times(panel: Any, drawn: Drawn) -> None:
    """Draw how often a time was how many times that of the plan."""
    if drawn.ratios:
        panel.hist(drawn.ratios, bins=min(_BINS, 4 + len(drawn.ratios) // 4), color=_BLUE)
        panel.yaxis.get_major_locator().set_params(integer=True)
        panel.axvline(1.0, color=_INK, linewidth=1.0, dashes=(4, 2))
    panel.set_xlabel("time, as a multiple of the plan's")
    panel.set_ylabel("parked")
    _dress(panel)


def _dress(panel: Any) -> None:
    panel.tick_params(labelsize=8)
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
