"""The one JSON document that a command prints with `--json`."""

import json
from typing import Annotated, Any

import typer

from race_server.terminal import say

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document to stdout.")]


def print_document(document: Any) -> None:
    """Print a document on one line and flush it: another program may wait for it.

    A number that is not finite becomes null: JSON has no word for it, and most readers stop at one.
    """
    plain = json.loads(json.dumps(document), parse_constant=lambda _: None)
    say(json.dumps(plain, allow_nan=False))
