"""`race drill`: things that must hold, shown on a running race."""

import json
from typing import Annotated

import typer
from rich.console import Console

from race_server.commands.race import AsJson, free_address

app = typer.Typer(help="Show on a running race that what must hold does hold.")


@app.callback()
def drills() -> None:
    """Show on a running race that what must hold does hold."""


@app.command()
def mixed(
    track: Annotated[str, typer.Option(help="Course.")] = "hangar-400",
    vehicle: Annotated[str, typer.Option(help="tt02, kart-30 or kart-60.")] = "kart-30",
    karts: Annotated[int, typer.Option(min=2, max=64, help="Two of them exist.")] = 8,
    laps: Annotated[int, typer.Option(min=1, help="Laps to the finish.")] = 2,
    seed: Annotated[int, typer.Option(help="Seed of all chance in the race.")] = 1,
    pedestrian: Annotated[
        float, typer.Option(help="Somebody steps in front after so many s of racing.")
    ] = 12.0,
    cut_link: Annotated[
        float, typer.Option(help="A radio goes off after so many s of racing.")
    ] = 110.0,
    delay_ms: Annotated[
        float, typer.Option(help="Added to each message of a real kart, each way.")
    ] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Race two real karts (plants) among simulated ones: a pedestrian, and a cut link."""
    from race_server.drills.mixed import Setting, run_drill

    setting = Setting(track, vehicle, karts, laps, seed, pedestrian, cut_link, delay_ms)
    found = run_drill(setting, free_address(), Console(stderr=True))
    if as_json:
        print(json.dumps(found))
    else:
        Console().print_json(json.dumps(found["figures"]))
        print("ok" if found["ok"] else "; ".join(found["why"]))
    if not found["ok"]:
        raise typer.Exit(1)
