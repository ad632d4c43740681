"""`race exam coaching`: whether the coach names faults that are known."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from race_agents.commands.exam_watch import examined
from race_server.cli.document import AsJson
from race_server.cli.options import names_in, once, seeds_from
from race_server.core.seeds import HELD_OUT
from race_server.errors import ScenarioError
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_agents.pupils.coaching_exam import CoachingExamSpec

SEEN = ", as spectators see them"


def coaching(
    tracks: Annotated[
        str,
        typer.Option("--tracks", "--track", help="Comma-separated names from `race track list`."),
    ] = "hangar-400",
    vehicle: Annotated[str, typer.Option(help="Vehicle of the simulated pupils.")] = "kart-60",
    seeds: Annotated[int, typer.Option(min=1, help="Pupils, each with other random errors.")] = 3,
    first_seed: Annotated[
        int, typer.Option(min=0, help="Seed of the first pupil; the next ones count up from it.")
    ] = HELD_OUT + 1,
    seen: Annotated[
        bool,
        typer.Option(
            "--seen", help="Look at laps as spectators of a live race do: by snapshots, no pedals."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Let simulated pupils drive with one known fault each, and count how many are named.

    Each kind of fault is driven in three sizes in each corner of each course by each pupil. A habit
    that costs less than 40 ms is counted as harmless. Weak motors cost time without a fault.
    """
    from race_agents.pupils.coaching_exam import CoachingExamSpec

    names = once(names_in(tracks))
    if not names:
        raise ScenarioError("--tracks is empty; name one or more, separated by commas")
    chosen = seeds_from(first_seed, seeds)
    specs = [CoachingExamSpec(name, vehicle, chosen, seen) for name in names]
    examined(
        lambda watch: {"rows": [_row(spec, watch) for spec in specs]},
        _show_all,
        as_json=as_json,
    )


def _row(spec: "CoachingExamSpec", watch: Callable[[str], None]) -> dict[str, Any]:
    """Return the exam of one course."""
    from race_agents.pupils.coaching_exam import School, document_of, examine

    school = School(spec.track, spec.vehicle)
    return document_of(spec, list(examine(spec, school, watch)), len(school.corners))


def _show_all(document: dict[str, Any]) -> None:
    for row in document["rows"]:
        _show(row)


def _show(row: dict[str, Any]) -> None:
    table = Table(
        title=f"{row['track']}, {row['vehicle']}, {row['seeds']} pupils{SEEN * row['seen']}"
    )
    table.add_column("fault", no_wrap=True)
    for head in ("laps", "named", "named otherwise"):
        table.add_column(head, justify="right")
    for kind in row["kinds"]:
        other = ", ".join(f"{word} {count}" for word, count in kind["named_otherwise"].items())
        table.add_row(kind["kind"], str(kind["laps"]), str(kind["named"]), other)
    console = Console()
    console.print(table)
    low, high = row["named_interval"]
    console.print(
        f"named {row['named']} of {row['faults']} ({100.0 * low:.1f}-{100.0 * high:.1f} %), "
        f"{row['harmless']} cost less than 40 ms; cost within 15 % or 20 ms in "
        f"{100.0 * (row['cost_near_share'] or 0.0):.1f} %\n"
        f"{row['cues']} cues: {100.0 * (row['cues_in_time_share'] or 0.0):.1f} % end 1.0 s before "
        "the place or sooner\n"
        f"clean laps: a fault in {row['clean_corners_with_a_fault']} of {row['clean_corners']} "
        f"corners; weak motors: {row['weak_corners_called_unknown']} of "
        f"{row['weak_corners_with_a_word']} called unknown",
        highlight=False,
    )
    for seed in row["failed_seeds"]:
        console.print(f"pupil {seed} did not come round without a fault", style="yellow")
