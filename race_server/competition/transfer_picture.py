"""A picture of a transfer: clean laps and lap times, change by change."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from race_server.competition.transfer import LADDER, TransferRow
from race_server.pictures import DRIVER_COLOURS, bare_axes, save_and_close

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
            bare_axes(panel)
    for panel in panels[-1]:
        panel.set_xticks(range(len(LADDER)), [rung.name for rung in LADDER])
    lines, names = panels[0][0].get_legend_handles_labels()
    figure.legend(lines, names, fontsize=8, loc="outside lower center", ncols=len(names))
    save_and_close(figure, path, dpi=150, facecolor="white")


def _draw(panel: Any, row: TransferRow, number: int, key: str, scale: float) -> None:
    """Draw a driver's figures over the ladder. number: of the driver."""
    places = [place + _APART * number for place in range(len(row.ladder))]
    # A driver that refused to drive has shown nothing.
    values = [
        float("nan") if one["failed"] or one[key] is None else scale * one[key]
        for one in row.ladder
    ]
    colour = DRIVER_COLOURS[number % len(DRIVER_COLOURS)]
    panel.plot(places, values, "o-", color=colour, linewidth=1.2, markersize=4, label=row.driver)
