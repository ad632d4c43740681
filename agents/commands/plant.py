"""`race plant`: a kart that exists, as far as the server can tell."""

import os
from pathlib import Path
from typing import Annotated

import typer

from race_server.cli.access import Connect, KeysFolder, SessionName, access


def plant(
    driver: Annotated[str, typer.Option(help="The installed driver at the wheel.")] = (
        "pure_pursuit"
    ),
    connect: Connect = "",
    session: SessionName = "",
    keys: KeysFolder = None,
    seat: Annotated[int, typer.Option(help="The seat wanted; -1 for any.")] = -1,
    patience: Annotated[float, typer.Option(help="Seconds to wait for a server.")] = 20.0,
    deviation: Annotated[
        float, typer.Option(help="Standard deviation of position fixes, in m; ten fixes a second.")
    ] = 0.02,
    delay_ms: Annotated[float, typer.Option(help="Added to every message, each way.")] = 0.0,
    pedestrian: Annotated[
        float | None, typer.Option(help="Somebody steps in front after so many s of racing.")
    ] = None,
    cut_link: Annotated[
        float | None, typer.Option(help="The radio goes off after so many s of racing.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the kart as built and of its sensors.")] = 1,
    report: Annotated[
        Path | None, typer.Option(help="Write what the kart did to this JSON file.")
    ] = None,
) -> None:
    """Play a real kart: own physics and sensors, a control unit that obeys and keeps it safe."""
    # Before any kernel is imported: a kart's own process needs no compiler.
    os.environ["RACE_SERVER_INTERPRET"] = "1"
    from race_agents.plant.kart import Sensors
    from race_agents.plant.run import PlantSetting, run_plant

    given = access(keys, connect, session)
    setting = PlantSetting(
        driver=driver,
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
