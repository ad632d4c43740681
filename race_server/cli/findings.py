"""What there is of courses or of car parks, and what a check of one found."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import typer

from race_server.cli.document import print_document
from race_server.errors import TrackError
from race_server.terminal import say

if TYPE_CHECKING:
    from race_server.scenario.track.check import CourseIssue


def rows_of(names: Iterable[str], row_of: Callable[[str], dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each name; one whose file is not valid is told on stderr, and left out."""
    rows = []
    for name in names:
        try:
            rows.append(row_of(name))
        except TrackError as error:
            say(f"warning: {error}", error=True)
    return rows


def print_findings(
    kind: str, name: str, vehicle: str, findings: "Sequence[CourseIssue]", as_json: bool
) -> None:
    """Print errors and warnings, and whether a place is good for a vehicle.

    kind: of the place, the key of its name in the document.

    Raises:
        typer.Exit: with code 1 if there is an error.
    """
    good = all(finding.level != "error" for finding in findings)
    if as_json:
        rows = [{"level": finding.level, "what": finding.what} for finding in findings]
        print_document({kind: name, "vehicle": vehicle, "ok": good, "findings": rows})
    else:
        for finding in findings:
            say(f"{finding.level}: {finding.what}")
        say(f"{name} is {'good' if good else 'not fit'} for {vehicle}")
    if not good:
        raise typer.Exit(1)
