"""The one way to a terminal: text is data, never markup, and moves no cursor.

Names, titles, paths and the texts of errors may come from outside. Colours are set by `style` and
`Text`, so no text has to be escaped.
"""

import sys
from collections.abc import Iterable
from io import TextIOWrapper
from typing import Any

import rich.console
import rich.progress
from rich.console import ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.segment import Segment
from rich.status import Status
from rich.text import Text

from race_server.printable import printable

# Of the widest table.
MOST_COLUMNS = 1000


class Console(rich.console.Console):
    """A console of rich that takes every string as it is, and prints only what can be seen."""

    def __init__(self, **options: Any) -> None:
        """Pass options on, such as `stderr` and `soft_wrap`."""
        super().__init__(markup=False, emoji=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the segments of whatever is shown, printable."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(_lines(segment.text), segment.style)

    def print_whole(self, table: RenderableType) -> None:
        """Print tables, wider than the terminal if necessary, so that nothing is cut off."""
        boundless = self.options.update(max_width=MOST_COLUMNS)
        self.width = max(self.width, Measurement.get(self, boundless, table).maximum)
        self.print(table)

    def status(self, status: RenderableType, **options: Any) -> Status:
        """Return a spinner beside a text, which rich would take for markup."""
        return super().status(Text(status) if isinstance(status, str) else status, **options)


class TextColumn(rich.progress.TextColumn):
    """A column of a progress bar that shows text as it is."""

    def __init__(self, text_format: str, **options: Any) -> None:
        """Show a format with `task` in it, such as `{task.description}`."""
        super().__init__(text_format, markup=False, **options)


def say(text: object, *, error: bool = False) -> None:
    """Print text to stdout, or to stderr, and flush it: another program may wait for it."""
    print(_lines(str(text)), file=sys.stderr if error else sys.stdout, flush=True)


def take_any_letter() -> None:
    """Have stdout write ? for a letter that its encoding lacks, as stderr writes an escape."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


def _lines(text: str) -> str:
    return "\n".join(map(printable, text.split("\n")))
