"""A picture of a transfer: clean laps and lap times, change by change."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from race_server.competition.transfer import LADDER, TransferRow
from race_server.pictures import save_and_close

_COLOURS = ("#1565c0", "#d84315", "#2e7d32", "#6a1b9a", "#00838f", "#f9a825")
_WIDTH, _HEIGHT = 11.0, 2.3  # [in]; of a track
_APART = 0.04  # between the lines of two drivers, so that both are seen


def draw_transfer(rows: Sequence[TransferRow], path: Path) -> None:
    """Draw each track in a line of two panels: clean laps, and lap times over the limit.

    Raises:
        ScenarioError: the file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    tracks = list(dict.fromkeys(row.track for row in rows))
    drivers = list(dict.fromkeys(row.driver for row in rows))
    size = (_WIDTH, 0.8 + _HEIGHT * len(tracks))
    figure, panels = pyplot.subplots(
        len(tracks), 2, figsize=size, layout="constrained", squeeze=False, sharex=True
    )
    for (shares, times), track in zip(panels, tracks, strict=True):
        for row in (row for row in rows if row.track == track):
            number = drivers.index(row.driver)
            _draw(shares, row, number, "clean_lap_rate", 100.0)
            _draw(times, row, number, "ratio", 1.0)
        shares.set_ylim(-5.0, 105.0)
        shares.set_title(track, loc="left", fontsize=9)
        shares.set_ylabel("clean laps [%]", fontsize=8)
        times.set_ylabel("lap over its limit", fontsize=8)
        for panel in (shares, times):
            panel.tick_params(labelsize=8)
            panel.grid(visible=True, alpha=0.25)
            for side in ("top", "right"):
                panel.spines[side].set_visible(False)
    for panel in panels[-1]:
        panel.set_xticks(range(len(LADDER)), [rung.name for rung in LADDER])
    panels[0][0].legend(fontsize=8, loc="lower left")
    save_and_close(figure, path, dpi=150, facecolor="white")


def _draw(panel: Any, row: TransferRow, number: int, key: str, scale: float) -> None:
    """Draw a driver's figures over the ladder. number: of the driver."""
    places = [place + _APART * number for place in range(len(row.ladder))]
    values = [float("nan") if one[key] is None else scale * one[key] for one in row.ladder]
    colour = _COLOURS[number % len(_COLOURS)]
    panel.plot(places, values, "o-", color=colour, linewidth=1.2, markersize=4, label=row.driver)
