"""What exams of the coach show while they run, and the document that they end with."""

import time
from collections.abc import Callable
from typing import Any

from rich.text import Text

from race_server.cli.document import print_document
from race_server.terminal import Console

Document = dict[str, Any]


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
