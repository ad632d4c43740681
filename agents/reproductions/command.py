"""`race reproduce`: a table of the reports, made again here and set beside theirs."""

import json
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from race_server.errors import ScenarioError

if TYPE_CHECKING:
    from agents.reproductions.run import News, Outcome

RESULTS = Path("docs") / "results"


def reproduce(
    name: Annotated[str, typer.Argument(help="Of the table; none: which there are.")] = "",
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer steps and seeds: minutes instead of hours.")
    ] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Trainings at once, a process each.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder; otherwise docs/results/NAME, quick in NAME-quick.")
    ] = None,
) -> None:
    """Make a table of the reports again: `race reproduce report-b-algorithms --quick`."""
    try:
        from agents.reproductions.run import reproduce as reproduce_it
        from agents.reproductions.shelf import reproduction_named, reproduction_names
    except ImportError as error:
        missing = (error.name or "a package").split(".")[0]
        raise ScenarioError(
            f"{missing} is not installed: `pip install race-server[train]` brings it"
        ) from error
    if not name:
        raise ScenarioError(f"name a table to make again: {', '.join(reproduction_names())}")
    plan = reproduction_named(name)
    place = out or RESULTS / (f"{name}-quick" if quick else name)
    console = Console(stderr=True)
    with _bar(console, quiet=as_json) as tell, warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="stable_baselines3")
        outcome = reproduce_it(name, plan, place, quick=quick, jobs=jobs, tell=tell)
    if as_json:
        print(json.dumps({"folder": str(place), "stopped": outcome.stopped, **outcome.document}))
    else:
        _show(outcome, quick=quick)
        console.print(f"table and plot: {place}", markup=False, soft_wrap=True)
    if outcome.stopped:
        console.print("stopped; the same command goes on", markup=False)
        sys.exit(130)


@contextmanager
def _bar(console: Console, *, quiet: bool) -> Iterator[Callable[["News"], None]]:
    """Show how many cells are done; without a terminal, say each that is."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=quiet or not console.is_terminal) as bar:
        task = bar.add_task("reproduction", total=1.0)

        def tell(news: "News") -> None:
            bar.update(task, completed=news.done, total=news.cells, description=news.name)
            if isinstance(news.done, int) and not quiet and not console.is_terminal:
                text = f"{news.done} of {news.cells}: {news.name}"
                console.print(text, markup=False, highlight=False)

        yield tell


def _show(outcome: "Outcome", *, quick: bool) -> None:
    from rich.table import Table

    from agents.reproductions.table import base_of, cells_of, heads_of, scale_words

    plan = outcome.plan
    title = f"{plan.title}\n{scale_words(outcome.scale, quick=quick)}"
    table = Table(title=title, title_justify="left", show_lines=True)
    for number, head in enumerate(heads_of(plan)):
        is_word = number <= len(plan.their_heads)
        table.add_column(head, justify="left" if is_word else "right")
    base = base_of(plan, outcome.lines)
    for line in outcome.lines:
        table.add_row(*cells_of(plan, line, base))
    console = Console()
    console.print(table)
    for remark in outcome.document["remarks"]:
        console.print(remark, markup=False, highlight=False)
