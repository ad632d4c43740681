"""`race reproduce`: repeat the experiments of a published report beside its own figures."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from race_server.cli.document import AsJson, print_document
from race_server.errors import ScenarioError, brought_by
from race_server.terminal import Console, TextColumn

if TYPE_CHECKING:
    from race_agents.reproductions.run import ReproductionProgress, ReproductionResult

RESULTS = Path("docs") / "results"
NAME_WIDTH = 14  # characters of a row's name on a narrow terminal
WORDY = ("remark", "finding")  # columns of the report that are sentences


def reproduce(
    name: Annotated[str, typer.Argument(help="Name of the table. Default: list all tables.")] = "",
    quick: Annotated[
        bool, typer.Option("--quick", help="Train fewer steps and seeds: minutes instead of hours.")
    ] = False,
    jobs: Annotated[
        int, typer.Option(min=1, help="Number of trainings in parallel, one process each.")
    ] = 1,
    rows: Annotated[
        str,
        typer.Option(
            help="Comma-separated rows to train: names or their beginnings. Default: all."
        ),
    ] = "",
    seeds: Annotated[
        int | None,
        typer.Option(min=1, help="Train at most this many runs of each row. Default: all."),
    ] = None,
    as_json: AsJson = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder to write. Default: docs/results/NAME; with --quick NAME-quick there."
        ),
    ] = None,
) -> None:
    """Reproduce a table of the reports: `race reproduce report-b-algorithms --quick`.

    Runs that were finished before are kept and shown too.
    """
    with brought_by("train"):
        from race_agents.reproductions.registry import reproduction_named, reproduction_names
        from race_agents.reproductions.run import reproduce as reproduce_it
        from race_agents.training.learner import without_warnings
    if not name:
        _list({one: reproduction_named(one).title for one in reproduction_names()}, as_json=as_json)
        return
    plan = reproduction_named(name)
    place = out or RESULTS / (f"{name}-quick" if quick else name)
    console = Console(stderr=True)
    try:
        with _bar(console) as tell, without_warnings():
            outcome = reproduce_it(
                name, plan, place, quick=quick, jobs=jobs, rows=rows, seeds=seeds, tell=tell
            )
    except OSError as error:
        raise ScenarioError(
            f"{error.filename or place}: {error.strerror or error}; the same command continues"
        ) from error
    if as_json:
        print_document({"folder": str(place), "stopped": outcome.stopped, **outcome.document})
    else:
        _show(outcome, quick=quick)
        console.print(f"table and plot: {place}", soft_wrap=True)
    if outcome.stopped:
        console.print("stopped; the same command continues")
        sys.exit(130)


def _list(titles: dict[str, str], *, as_json: bool) -> None:
    """List all tables."""
    if as_json:
        print_document([{"name": name, "title": title} for name, title in titles.items()])
        return
    console = Console()
    for name, title in titles.items():
        console.print(f"{name}: {title}", highlight=False)


@contextmanager
def _bar(console: Console) -> Iterator[Callable[["ReproductionProgress"], None]]:
    """Show how many runs are finished; without a terminal, print each as it begins and ends."""
    from rich.progress import BarColumn, Progress, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("reproduction", total=1.0)
        begun: set[str] = set()

        def tell(news: "ReproductionProgress") -> None:
            bar.update(task, completed=news.done, total=news.trainings, description=news.name)
            if console.is_terminal:
                return
            if isinstance(news.done, int):
                console.print(f"{news.done} of {news.trainings}: {news.name}", highlight=False)
            elif news.name not in begun:
                begun.add(news.name)
                console.print(f"learns: {news.name}", highlight=False)

        yield tell


def _show(outcome: "ReproductionResult", *, quick: bool) -> None:
    from rich.table import Table

    from race_agents.reproductions.table import (
        base_of,
        heads_of,
        partial_words,
        scale_words,
        texts_of,
    )

    plan, base = outcome.plan, base_of(outcome.plan, outcome.lines)
    title = f"{plan.title}\n{scale_words(outcome.scale, outcome.lines, quick=quick)}"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    heads = heads_of(plan)
    texts = [
        texts_of(plan, line, base, plan.runs_of(line.row, outcome.scale)) for line in outcome.lines
    ]
    # Texts of the report would leave no room for figures.
    shown = [number for number, head in enumerate(heads) if not head.endswith(WORDY)]
    for number in shown:
        justify: Literal["left", "right"] = "right" if number else "left"
        # A name may be folded, a figure may not.
        longest = [*heads[number].split(), *(row[number] for row in texts if number)]
        width = max(len(word) for word in longest) if number else NAME_WIDTH
        table.add_column(heads[number], justify=justify, width=width)
    console = Console()
    for row in texts:
        table.add_row(*(row[number] for number in shown))
    # Wider than the terminal if necessary, so that the last figures are shown.
    least = sum((column.width or 0) + 2 for column in table.columns)
    console.width = max(console.width, least)
    console.print(table)
    if words := partial_words(plan, outcome.scale, outcome.lines):
        console.print(words, highlight=False)
    if base is not None:
        console.print(f"in brackets: the difference to {base.row.name}", highlight=False)
    for number, head in enumerate(heads):
        if number not in shown:
            words = "".join(f"\n  {row[0]}: {row[number]}" for row in texts)
            console.print(f"{head}{words}", highlight=False)
    for remark in outcome.document["remarks"]:
        console.print(remark, highlight=False)
