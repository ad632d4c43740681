"""`race drill evening`: a whole event, its server killed in each phase."""

from pathlib import Path
from typing import Annotated

import typer

from race_server.cli.document import AsJson
from race_server.cli.drill_report import finish, progress


def evening(
    browsers: Annotated[
        int,
        typer.Option(
            min=0,
            max=2,
            help="Drivers that are people at the page, in a Chromium that presses keys.",
        ),
    ] = 0,
    keep: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="New folder for the event, its recordings and results, and pictures of the page.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run an event of six drivers, and kill its server in each phase; takes about eight minutes.

    Time trial, qualification, two heats and a final. Its file, the results file and the result
    document must agree, and each attempt and race must count once.
    """
    with progress("driving", 21) as tell:
        from race_server.tools.drills.evening import drill_evening

        document = drill_evening(browsers, keep, tell)
    finish(document, as_json=as_json)
