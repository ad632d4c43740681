"""`race plant`: a simulated stand-in for a real kart."""

import os
from pathlib import Path
from typing import Annotated

import typer

from race_server.cli.access import Connect, KeysFolder, SessionName, access


def plant(
    driver: Annotated[str, typer.Option(help="Installed driver of the kart.")] = ("pure_pursuit"),
    valet: Annotated[
        str, typer.Option(help="Driver that parks the kart when the server orders that.")
    ] = "valet",
    on_request: Annotated[
        bool,
        typer.Option(
            "--on-request",
            help="In a car park: stand until the server orders the kart to park.",
        ),
    ] = False,
    connect: Connect = "",
    session: SessionName = "",
    keys: KeysFolder = None,
    seat: Annotated[
        int, typer.Option(help="Number of the seat to take; -1: any, or the one in the keys.")
    ] = -1,
    patience: Annotated[float, typer.Option(help="Seconds to wait for the server.")] = 20.0,
    deviation: Annotated[
        float, typer.Option(help="Standard deviation of the position fixes [m], ten a second.")
    ] = 0.02,
    delay_ms: Annotated[float, typer.Option(help="Delay of every message, each way [ms].")] = 0.0,
    pedestrian: Annotated[
        float | None,
        typer.Option(
            help="Time at which a pedestrian steps in front of the kart [s]. Default: none."
        ),
    ] = None,
    cut_link: Annotated[
        float | None, typer.Option(help="Time at which the radio link is lost [s]. Default: never.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the kart as built and of its sensors.")] = 1,
    report: Annotated[
        Path | None, typer.Option(help="Write a report on the kart to this JSON file.")
    ] = None,
) -> None:
    """Play a real kart: its own physics, sensors and control unit, tracked by the server."""
    # Set before any kernel is imported: one kart needs no compiler.
    os.environ["RACE_SERVER_INTERPRET"] = "1"
    from race_agents.plant.run import PlantSetting, run_plant
    from race_agents.plant.sensors import Sensors

    given = access(keys, connect, session)
    setting = PlantSetting(
        driver=driver,
        valet=valet,
        on_request=on_request,
        seat=given.seat(seat),
        address=given.address,
        session=given.session,
        keys=given.keys,
        patience_s=patience,
        delay_s=delay_ms / 1000.0,
        sensors=Sensors(fix_deviation=deviation),
        seed=seed,
        pedestrian_s=pedestrian,
        cut_s=cut_link,
        report=report,
    )
    run_plant(setting)
