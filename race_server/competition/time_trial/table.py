"""Tables of a trial for the terminal, and rows of its laps."""

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from race_server.competition.time_trial.figures import Loss, TrialSummary
from race_server.competition.time_trial.gaps import NONE
from race_server.competition.time_trial.report_b import LAPS, RACE_DAY, VALIDATION_TRACK
from race_server.competition.time_trial.run import Run
from race_server.core.clock import MICROSECONDS, lap_text

_NOTHING = "–"


def _table(title: str, words: Sequence[str], figures: Sequence[str]) -> Table:
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        header_style="dim underline",
        box=None,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for name in words:
        table.add_column(name, no_wrap=True)
    for name in figures:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def seconds_text(seconds: float | None) -> str:
    """Return a time [s] as text, a dash for none."""
    return lap_text(None if seconds is None else round(seconds * MICROSECONDS))


def _ratio_text(ratio: float | None) -> str:
    return _NOTHING if ratio is None else f"{ratio:.3f}"


def _interval_text(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return ""
    if high >= 60.0:
        return f"{seconds_text(low)}–{seconds_text(high)}"
    return f"{low:.2f}–{high:.2f}"


def tables_of(rows: Sequence[TrialSummary], gaps: dict[str, str]) -> Group:
    """Return a table for each track and vehicle. gaps: what each setting means, by name."""
    parts: list[Table | Text] = []
    for (track, vehicle), group in groupby(rows, lambda row: (row.track, row.vehicle)):
        found = list(group)
        limit = found[0].limit_s
        told = f"limit {seconds_text(limit)}" if limit else f"no limit: {found[0].limit_reason}"
        parts.append(_rows_table(f"{track}, {vehicle}", found, with_gap=len(gaps) > 1))
        parts += [
            Text(f"{_who(row, gaps)}: {row.remark}", style="red" if row.failed else "yellow")
            for row in found
            if row.remark
        ]
        parts.append(Text(told + "\n", style="dim"))
    if len(gaps) > 1:
        parts.append(Text("\n".join(f"{name}: {words}" for name, words in gaps.items()) + "\n"))
    return Group(*parts)


def _who(row: TrialSummary, gaps: dict[str, str]) -> str:
    return row.driver if len(gaps) == 1 else f"{row.driver}, {row.gap}"


_INTERVAL, _STANDING = "95 %", ("from rest", "total")
# The columns of a table, and the text of each for a row.
_FIGURES: dict[str, Callable[[TrialSummary], str]] = {
    "laps": lambda row: f"{row.laps}/{row.laps_wanted}",
    "clean": lambda row: f"{100.0 * row.clean_lap_rate:.0f} %",
    "median": lambda row: seconds_text(row.median_lap_s),
    _INTERVAL: lambda row: _interval_text(row.median_low_s, row.median_high_s),
    "best": lambda row: seconds_text(row.best_lap_s),
    "spread": lambda row: _NOTHING if row.spread_s is None else f"{row.spread_s:.3f}",
    "ratio": lambda row: _ratio_text(row.ratio),
    "crashes": lambda row: str(row.crashes),
    "from rest": lambda row: seconds_text(row.standing_lap_s),
    "total": lambda row: seconds_text(row.total_s),
}


def _rows_table(title: str, rows: Sequence[TrialSummary], *, with_gap: bool) -> Table:
    is_standing = any(row.standing_lap_s for row in rows)
    hidden = {_INTERVAL} if is_standing and with_gap else set()  # to fit into eighty columns
    hidden |= set() if is_standing else set(_STANDING)
    names = [name for name in _FIGURES if name not in hidden]
    table = _table(title, ["driver", "gap"] if with_gap else ["driver"], names)
    for row in rows:
        words = [row.driver, row.gap] if with_gap else [row.driver]
        figures = [_FIGURES[name](row) for name in names]
        table.add_row(*words, *figures, style="red" if row.failed else "")
    return table


def loss_tables(losses: Sequence[Loss]) -> Group:
    """Return tables of what the reality gaps cost, by track and vehicle."""
    tables: list[Table | Text] = []
    for (track, vehicle), group in groupby(losses, lambda loss: (loss.track, loss.vehicle)):
        table = _table(
            f"what degrades on {track}, {vehicle}",
            ("driver", "gap"),
            ("median", "clean laps", "spread, s", "crashes", "laps"),
        )
        for loss in group:
            table.add_row(loss.driver, loss.gap, *_loss_cells(loss))
        tables += [table, Text()]
    return Group(*tables)


def _loss_cells(loss: Loss) -> tuple[str, ...]:
    change = None if loss.median_ratio is None else 100.0 * (loss.median_ratio - 1.0)
    spread = loss.spread_change_s
    return (
        _NOTHING if change is None else f"{change:+.1f} %",
        f"{100.0 * loss.clean_lap_rate_change:+.0f} points",
        _NOTHING if spread is None else f"{spread:+.3f}",
        f"{loss.crashes_change:+d}",
        f"{loss.laps_change:+d}",
    )


def ghost_table(name: str, rows: Iterable[tuple[str, float, Sequence[float]]]) -> Table:
    """Return a table of the losses of best laps on a ghost: driver, whole lap, sectors [s]."""
    found = list(rows)
    sectors = max((len(lost) for _, _, lost in found), default=0)
    numbers = [f"sector {number}" for number in range(1, sectors + 1)]
    table = _table(f"best laps against the ghost {name}", ("driver",), ("lap", *numbers))
    for driver, lap, lost in found:
        table.add_row(driver, f"{lap:+.3f}", *(f"{part:+.3f}" for part in lost))
    return table


def beside_report_b(rows: Sequence[TrialSummary], words: dict[str, str]) -> Group:
    """Return our laps below those of the report. words: a description of each driver."""
    table = _table(
        "time trial on the validation track, the report's (table 5.3) and ours",
        ("driver",),
        (),
    )
    table.add_column("particularity")
    for name in ("lap time", "crashes"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("remark")
    for lap in LAPS:
        table.add_row(lap.network, lap.particularity, lap.lap, lap.crashes or _NOTHING, lap.remark)
    table.add_section()
    for row in rows:
        if row.track == VALIDATION_TRACK:
            table.add_row(*_our_lap(row, words))
    parts: list[Table | Text] = [table]
    if all(row.track != VALIDATION_TRACK for row in rows):
        parts.append(Text(f"add {VALIDATION_TRACK} to --tracks to see laps of ours here"))
    note = (
        "Report: one lap a network, in the race's simulator; a dash where it does not speak of "
        f"crashes. Ours: median flying lap of {VALIDATION_TRACK}, likely the same track; crashes "
        "are all contacts with walls.\n"
    )
    return Group(*parts, Text(note, style="dim"), _race_day(rows))


def _our_lap(row: TrialSummary, words: dict[str, str]) -> tuple[str, ...]:
    particular = words.get(row.driver, "")
    if row.gap != NONE.name:
        particular += f" (gap: {row.gap})"
    remark = f"{100.0 * row.clean_lap_rate:.0f} % of {row.laps_wanted} laps clean"
    if row.ratio:
        remark += f", {row.ratio:.2f} of the limit"
    if row.remark:
        remark += f"; {row.remark}"
    time = seconds_text(row.median_lap_s) if row.median_lap_s else "none"
    return (row.driver, particular, time, str(row.crashes), remark)


def _race_day(rows: Sequence[TrialSummary]) -> Table:
    table = _table(
        "two laps from standstill: race day 2023, other tracks, and ours, in s",
        ("driver",),
        ("empty track", "fixed obstacles"),
    )
    for day in RACE_DAY:
        pairs = (day.empty, day.obstacles)
        table.add_row(day.team, *("  ".join(_attempt(time) for time in pair) for pair in pairs))
    table.add_section()
    ours = [
        row
        for row in rows
        if row.total_s and row.standing_lap_s and row.laps_wanted == 2 * row.seeds
    ]
    for row in ours:
        gap = "" if row.gap == NONE.name else f" (gap: {row.gap})"
        table.add_row(f"{row.driver}, {row.track}{gap}", f"{row.total_s:.1f}", _NOTHING)
    if not ours:
        table.add_row("ours: with --start standing --laps 2", "", "")
    return table


def _attempt(seconds: int) -> str:
    return "failed" if seconds >= 120 else str(seconds)


def lap_rows(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """Return every lap as a plain row."""
    return [
        {
            "driver": run.spec.driver,
            "track": run.spec.track,
            "vehicle": run.spec.vehicle,
            "gap": run.spec.gap.name,
            "seed": run.spec.seed,
            "lap": lap.number,
            "lap_s": lap.time_s,
            "is_flying": lap.is_flying,
            "is_clean": lap.is_clean,
            "contacts": lap.contacts,
            "rescues": lap.rescues,
            "off_track_s": round(lap.off_track_s, 3),
            "steering_rate": round(lap.steering_rate, 4),
            "jerk": round(lap.jerk, 3),
            "sectors_s": [sector / MICROSECONDS for sector in lap.sectors_us],
        }
        for run in runs
        for lap in run.laps
    ]
