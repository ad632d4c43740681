"""A picture of a sweep: clean laps over the steps of each factor."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from race_server.competition.lap_sweep import HELD, SWEEPS, SweepRow
from race_server.pictures import DRIVER_COLOURS, bare_axes, save_and_close

_COLUMNS = 4
_WIDTH, _HEIGHT = 12.0, 2.3  # [in]; of a line of panels
_APART = 1.2  # [%] between the lines of two drivers, so that both are seen


def draw_sweep(rows: Sequence[SweepRow], path: Path) -> None:
    """Draw a panel for each factor, and in it a line for each driver.

    Raises:
        ScenarioError: the file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    factors = list(dict.fromkeys(row.factor for row in rows))
    drivers = list(dict.fromkeys(row.driver for row in rows))
    lines = -(-len(factors) // _COLUMNS)
    size = (_WIDTH, 0.6 + _HEIGHT * lines)
    figure, panels = pyplot.subplots(
        lines, _COLUMNS, figsize=size, layout="constrained", squeeze=False, sharey=True
    )
    for panel in panels.flat[len(factors) :]:
        panel.set_visible(False)
    for panel, factor in zip(panels.flat, factors, strict=False):
        group = [row for row in rows if row.factor == factor]
        for row in group:
            _draw(panel, row, drivers.index(row.driver))
        steps = next(sweep.steps for sweep in SWEEPS if sweep.name == factor)
        panel.set_xticks(range(len(steps)), [f"{step:g}" for step in steps])
        panel.set_xlim(-0.4, len(steps) - 0.6)
        panel.axhline(100.0 * HELD, color="#20242a", linewidth=0.8, dashes=(4, 2))
        panel.set_title(f"{factor} [{group[0].unit}]", loc="left", fontsize=9)
        panel.set_ylim(-5.0, 110.0)
        bare_axes(panel)
    for left in panels[:, 0]:
        left.set_ylabel("clean laps [%]", fontsize=8)
    lines, names = panels[0][0].get_legend_handles_labels()
    figure.legend(lines, names, fontsize=8, loc="outside lower center", ncols=len(names))
    save_and_close(figure, path, dpi=150, facecolor="white")


def _draw(panel: Any, row: SweepRow, number: int) -> None:
    """Draw a driver's clean laps. number: of the driver."""
    values = [100.0 * one["clean_lap_rate"] + _APART * number for one in row.steps]
    colour = DRIVER_COLOURS[number % len(DRIVER_COLOURS)]
    panel.plot(
        range(len(values)),
        values,
        "o-",
        color=colour,
        linewidth=1.2,
        markersize=4,
        label=row.driver,
    )
