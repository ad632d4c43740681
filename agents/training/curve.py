"""The curve of a training: a table that grows, and its picture."""

import csv
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from race_server.kept_file import write_together
from race_server.pictures import save

Panels = dict[str, tuple[str, ...]]
# Panels of the picture: columns from training and from evaluation. Of a race, and of a lot.
RACE: Panels = {
    "return": ("reward", "tried_reward"),
    "speed [m/s]": ("tried_speed",),
    "crash rate": ("crash_rate", "tried_crash_rate"),
    "best lap [s]": ("best_lap_s", "tried_best_lap_s"),
}
LOT: Panels = {
    "return": ("reward", "tried_reward"),
    "share that parks": ("parked", "tried_parked"),
    "share that is aligned": ("aligned", "tried_aligned"),
    "collisions": ("hits", "tried_hits"),
}


@dataclass(frozen=True)
class Point:
    """Figures of a training at one moment; None for those not measured."""

    minutes: float
    steps: int
    steps_per_s: float
    learning_rate: float
    reward: float | None = None  # of the last hundred episodes
    crash_rate: float | None = None
    best_lap_s: float | None = None
    tried_speed: float | None = None  # in the evaluation [m/s]
    tried_crash_rate: float | None = None
    tried_best_lap_s: float | None = None
    tried_reward: float | None = None
    rating: float | None = None  # of the newest snapshot, in self-play
    rating_sigma: float | None = None
    stage: int | None = None  # of the curriculum, from 1 on
    parked: float | None = None  # share of the last hundred episodes
    aligned: float | None = None
    hits: float | None = None
    tried_parked: float | None = None  # in the evaluation
    tried_aligned: float | None = None
    tried_hits: float | None = None


def append(path: Path, point: Point) -> None:
    """Add a row to the table; the first row writes the head, later ones follow it."""
    head = _head_of(path)
    with path.open("a", newline="", encoding="utf-8") as file:
        names = head or [field.name for field in fields(Point)]
        table = csv.DictWriter(file, names, extrasaction="ignore")
        if not head:
            table.writeheader()
        row = {
            name: float(f"{value:.6g}") if isinstance(value, float) else value
            for name, value in asdict(point).items()
        }
        table.writerow(row)


def cut(path: Path, steps: int) -> None:
    """Leave out the rows of decisions that a checkpoint does not know of: they are made again.

    A row that was cut off, as by a full disk, goes with them, and a table without a head as a
    whole.
    """
    if not path.is_file():
        return
    text = path.read_bytes().decode("utf-8", errors="replace")
    head, *lines = text.splitlines(keepends=True) or [""]
    names = head.rstrip("\r\n").split(",")
    if not head.endswith("\n") or not {"minutes", "steps"} <= set(names):
        path.unlink()
        return
    kept = [line for line in lines if 0 <= _steps_in(line, names) <= steps]
    write_together({path: "".join([head, *kept]).encode()})


def _steps_in(line: str, names: list[str]) -> int:
    """Return the decisions that a row tells of; -1 if it is no whole row of numbers."""
    cells = line.rstrip("\r\n").split(",")
    if not line.endswith("\n") or len(cells) != len(names):
        return -1
    row = dict(zip(names, cells, strict=True))
    try:
        _ = [float(cell) for cell in cells if cell]
        return int(row["steps"]) if row["minutes"] else -1
    except ValueError:
        return -1


def _head_of(path: Path) -> list[str]:
    """Return the names of a table's columns; a run of an older version has fewer."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return next(csv.reader(file), [])


def read(path: Path) -> list[dict[str, float]]:
    """Return the rows of a table, without missing figures."""
    with path.open(newline="", encoding="utf-8") as file:
        return [
            {name: float(value) for name, value in row.items() if value}
            for row in csv.DictReader(file)
        ]


def draw(table: Path, picture: Path, title: str) -> None:
    """Draw the figures of a training over its minutes."""
    from matplotlib.figure import Figure

    rows = read(table)
    panels = LOT if any("tried_parked" in row for row in rows) else RACE
    figure = Figure(figsize=(9.0, 8.5), layout="constrained")
    plots: Any = figure.subplots(len(panels), 1, sharex=True)
    for plot, (label, columns) in zip(plots, panels.items(), strict=True):
        for column in columns:
            _draw_column(plot, rows, column)
        plot.set_ylabel(label)
        plot.grid(alpha=0.3)
        if plot.get_legend_handles_labels()[0]:
            plot.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
        else:
            plot.text(0.5, 0.5, "none", ha="center", transform=plot.transAxes)
            plot.set_yticks([])
    for row, before in zip(rows[1:], rows, strict=False):
        if row.get("stage") != before.get("stage"):
            _mark_stage(plots, row)
    plots[-1].set_xlabel("minutes of training")
    figure.suptitle(title)
    save(figure, picture, dpi=110)


def _draw_column(plot: Any, rows: list[dict[str, float]], column: str) -> None:
    """Draw one column if it has figures: evaluations as points, in orange."""
    points = [(row["minutes"], row[column]) for row in rows if column in row]
    if not points:
        return
    is_tried = column.startswith("tried")
    look, colour = ("o-", "tab:orange") if is_tried else ("-", "tab:blue")
    name = "evaluation" if is_tried else "training"
    plot.plot(*zip(*points, strict=True), look, color=colour, label=name, markersize=3)


def _mark_stage(plots: Any, row: dict[str, float]) -> None:
    """Mark where a stage of the curriculum begins."""
    for plot in plots:
        plot.axvline(row["minutes"], color="grey", linestyle=":", linewidth=1)
    at = plots[0].get_xaxis_transform()
    text = f" stage {row.get('stage', 0.0):.0f}"
    plots[0].text(row["minutes"], 1.0, text, transform=at, va="bottom", fontsize=8)
