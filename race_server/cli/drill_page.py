"""`race drill page`: a race in front of many browsers."""

from typing import Annotated

import typer

from race_server.cli.document import AsJson
from race_server.cli.drill_report import finish, progress


def page(
    clients: Annotated[
        int, typer.Option(min=1, max=1000, help="Number of browsers that watch at each gateway.")
    ] = 100,
    gateways: Annotated[int, typer.Option(min=1, max=8, help="Number of gateways.")] = 1,
    router: Annotated[
        bool, typer.Option("--router", help="Put a zenoh router between server and gateways.")
    ] = False,
    minutes: Annotated[float, typer.Option(min=0.1, max=14.0, help="Minutes of racing.")] = 5.0,
    as_json: AsJson = False,
) -> None:
    """Race in front of browsers, some of which misbehave."""
    from race_server.tools.drills.page import drill_page

    with progress("racing", round(60 * minutes)) as tell:
        document = drill_page(clients, minutes, gateways=gateways, has_router=router, tell=tell)
    finish(document, as_json=as_json, columns=("without", "with"))
