"""The table of `race exam parking`, with the tasks that failed below it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from race_agents.commands.exam_result import Result
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.competition.parking_rounds import RoundTally

# Seeds of failures that are told to a person, of each kind.
MOST_TOLD = 8


def show_parking(results: Sequence[Result]) -> None:
    """Print a row for each result, and below them which tasks failed and how."""
    from rich.table import Table

    table = Table()
    for head in ("driver", "lot", "level"):
        table.add_column(head, no_wrap=True)
    heads = ("parked", "95 %", "aligned", "hits", "people", "time s", "× plan", "way m", "× plan")
    for head in (*heads, "changes"):
        table.add_column(head, justify="right", no_wrap=True)
    for result in results:
        row, tally = result.row(), result.tally
        low, high = tally.success_interval
        table.add_row(
            *(result.driver, result.spec.lot, row["level"]),
            f"{100.0 * tally.success_rate:.1f} %",
            f"{100.0 * low:.1f}-{100.0 * high:.1f} %",
            f"{100.0 * tally.aligned_rate:.1f} %",
            *(str(tally.collisions), str(tally.hit_people)),
            *(_figure(tally.time_s_median, 1), _figure(row["time_ratio_median"], 2)),
            *(_figure(tally.path_m_median, 1), _figure(row["path_ratio_median"], 2)),
            _figure(tally.direction_changes_mean, 2),
        )
    console = Console()
    console.print_whole(table)
    for result in results:
        for ending, seeds in result.failed_seeds().items():
            told = ", ".join(map(str, seeds[:MOST_TOLD])) + (", …" * (len(seeds) > MOST_TOLD))
            name = f"{result.driver}, {result.spec.lot}"
            console.print(f"{name}: {ending} {len(seeds)}, seeds {told}", highlight=False)
        if result.hopeless:
            seed, fault = min(result.hopeless.items())
            console.print(
                f"{result.driver}, {result.spec.lot}: in {len(result.hopeless)} of these rounds a "
                f"vehicle could never park, see race lot check; seed {seed}: {fault}",
                style="yellow",
                highlight=False,
            )
        if result.rounds is not None:
            _show_rounds(result, result.rounds, console)
        for fault in result.row()["faults"]:
            console.print(f"{result.driver} raised {fault}", style="yellow", highlight=False)


def _show_rounds(result: Result, rounds: "RoundTally", console: Console) -> None:
    low, high = (100.0 * bound for bound in rounds.all_parked_interval)
    mean_s = rounds.last_time_s_mean
    last = "" if mean_s is None else f", the last after {mean_s:.1f} s in the mean"
    parked = round(rounds.rounds * rounds.all_parked_rate)
    console.print(
        f"{result.driver}, {result.spec.lot}: all {result.spec.vehicles} vehicles parked in "
        f"{parked} of {rounds.rounds} rounds ({low:.1f}-{high:.1f} %){last}; contacts in "
        f"{rounds.with_contact}, deadlocks in {rounds.deadlocks}",
        highlight=False,
    )


def _figure(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
