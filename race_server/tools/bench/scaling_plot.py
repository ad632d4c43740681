"""A picture of how the speed of the training world depends on karts, worlds and cores."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from race_server.errors import ScenarioError
from race_server.pictures import save
from race_server.tools.bench.env import (
    CORE_COUNTS,
    CROWD,
    CROWDED_TRACK,
    CROWDED_VEHICLE,
    KARTS,
    TRACK,
    WORLDS,
)

_INK, _GREY, _RADAR, _LIDAR = "#20242a", "#6b7280", "#1565c0", "#ef6c00"


def plot_scaling(scaling: dict[str, Any], path: Path) -> None:
    """Draw what `bench_scaling` returned into a file.

    Raises:
        ScenarioError: the file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 3, figsize=(14.0, 4.8), layout="constrained")
    title = (
        f"Speed of the training world on a machine with {os.cpu_count()} cores "
        "(an agent-step is one kart's decision of 1/20 s)"
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, color=_INK)
    _draw_line(panels[0], scaling["karts_per_race"], "karts in a race")
    crowd = f"{CROWD} {CROWDED_VEHICLE} in all on {CROWDED_TRACK}, radar, one core"
    _dress(panels[0], "How large a race may be", crowd)
    _draw_line(panels[1], scaling["worlds"], "races at once")
    races = f"races of {KARTS} on {TRACK}"
    _dress(panels[1], "How many races make a batch", f"{races}, radar, one core")
    _draw_bars(panels[2], scaling["cores"])
    _dress(panels[2], "What a second core adds", f"{WORLDS} {races}")
    try:
        save(figure, path, dpi=130, facecolor="white")
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{path}: the picture cannot be written: {error}") from error
    finally:
        pyplot.close(figure)


def _draw_line(axes: Any, points: dict[str, int], across: str) -> None:
    counts, rates = [int(count) for count in points], list(points.values())
    axes.plot(counts, rates, color=_RADAR, marker="o", linewidth=2.0, markersize=6.0)
    for count, number in zip(counts, rates, strict=True):
        axes.annotate(
            _thousands(number),
            (count, number),
            xytext=(0, 10),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            color=_INK,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        )
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.minorticks_off()
    axes.set_xticks(counts, [f"{count}" for count in counts])
    axes.set_xlim(counts[0] / 1.5, counts[-1] * 1.5)
    low, high = min(*rates, 1e5), max(*rates, 5e5) * 1.05
    steps = [step * 10**power for power in range(2, 8) for step in (1, 2, 3, 5)]
    shown = [step for step in steps if low <= step <= high]
    axes.set_yticks(shown, [_thousands(step) for step in shown])
    axes.set_ylim(low, high)
    axes.set_xlabel(across)
    axes.set_ylabel("agent-steps per second")


def _draw_bars(axes: Any, cores: dict[str, dict[str, int]]) -> None:
    width = 0.36
    for number, (kind, colour) in enumerate((("radar", _RADAR), ("lidar", _LIDAR))):
        rates = list(cores[kind].values())
        places = np.arange(len(rates)) + (number - 0.5) * width
        bars = axes.bar(places, rates, width * 0.94, color=colour, label=kind)
        labels = [f"{_thousands(rate)}\n× {rate / rates[0]:.2f}" for rate in rates]
        axes.bar_label(bars, labels, padding=3, fontsize=9, color=_INK)
    axes.set_xticks(range(len(CORE_COUNTS)), [f"{count}" for count in CORE_COUNTS])
    axes.set_ylim(0, 1.3 * max(max(rates.values()) for rates in cores.values()))
    axes.yaxis.set_major_formatter(lambda value, _: _thousands(value))
    axes.set_xlabel("cores used")
    axes.set_ylabel("agent-steps per second")
    axes.legend(loc="upper center", ncols=2, frameon=False, fontsize=9)


def _thousands(number: float) -> str:
    return f"{number / 1e3:.0f} k"


def _dress(axes: Any, title: str, setting: str) -> None:
    axes.set_title(title, loc="left", fontsize=11, color=_INK, pad=22)
    axes.text(0.0, 1.02, setting, transform=axes.transAxes, fontsize=8, color=_GREY)
    axes.grid(axis="both" if axes.get_xscale() == "log" else "y", color="#d8dce2", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, colors=_GREY)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
