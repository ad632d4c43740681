"""What exams show while they run, and the document that those of the coach end with."""

import time
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from rich.text import Text

from race_server.cli.document import print_document
from race_server.terminal import Console, TextColumn

TOLD_S = 15.0  # between two lines where no bar can be shown

Document = dict[str, Any]
Outcome = TypeVar("Outcome")


def counted(
    total: int,
    examine: Callable[[Callable[[str], None]], Iterable[Outcome]],
    console: Console,
) -> tuple[list[Outcome], bool]:
    """Return what an exam finished, and whether Ctrl-C stopped it, with a bar that counts.

    examine: is given a function that tells people what goes on now.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    hidden = not console.is_terminal
    outcomes: list[Outcome] = []
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=hidden
    ) as bar:
        task = bar.add_task("getting ready; compiling takes minutes, once", total=total)

        told = time.monotonic()

        def watch(words: str) -> None:
            nonlocal told
            bar.update(task, description=words)
            if hidden and time.monotonic() - told > TOLD_S:
                told = time.monotonic()
                console.print(f"{len(outcomes)} of {total}: {words}", soft_wrap=True)

        try:
            for outcome in examine(watch):
                outcomes.append(outcome)
                bar.update(task, advance=1)
        except KeyboardInterrupt:
            return outcomes, True
    return outcomes, False


def examined(
    examine: Callable[[Callable[[str], None]], Document],
    show: Callable[[Document], None],
    *,
    as_json: bool,
) -> None:
    """Hold an exam, then print its document, or show it.

    examine: is given a function that tells people what goes on now.
    """
    begun = time.monotonic()
    with Console(stderr=True).status("getting ready", spinner="dots") as status:
        document = examine(lambda words: status.update(Text(words)))
    if as_json:
        print_document(document | {"wall_s": round(time.monotonic() - begun, 1)})
    else:
        show(document)
