"""`race drill evening`: a whole event, its server killed in each phase."""

from race_server.cli.document import AsJson
from race_server.cli.drill_report import finish, progress


def evening(as_json: AsJson = False) -> None:
    """Run an event of six drivers, and kill its server in each phase; takes about eight minutes.

    Time trial, qualification, two heats and a final. Its file, the results file and the result
    document must agree, and each attempt and race must count once.
    """
    with progress("driving", 21) as tell:
        from race_server.tools.drills.evening import drill_evening

        document = drill_evening(tell)
    finish(document, as_json=as_json)
