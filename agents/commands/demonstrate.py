"""`race demonstrate`: laps of a driver go into a file from which others learn."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from race_server.cli.document import AsJson, print_document
from race_server.cli.options import names_in
from race_server.errors import ScenarioError, brought_by


def demonstrate(
    driver: Annotated[
        str, typer.Argument(help="An installed driver, such as raceline; none with --recording.")
    ] = "",
    tracks: Annotated[
        str, typer.Option("--tracks", "--track", help="Comma-separated names of tracks.")
    ] = "covapsy-train-2023",
    laps: Annotated[int, typer.Option(min=1, help="On each track.")] = 5,
    vehicle: Annotated[str, typer.Option(help="Such as tt02 or kart-60.")] = "tt02",
    seed: Annotated[int, typer.Option(min=0, help="Of sensors, start and noise.")] = 1,
    noise: Annotated[
        float,
        typer.Option(
            min=0.0, max=1.0, help="Deviation of pedals and wheel, against which the driver drives."
        ),
    ] = 0.0,
    recording: Annotated[
        Path | None, typer.Option(help="A recorded race, .mcap, instead of driving one.")
    ] = None,
    seat: Annotated[int, typer.Option(min=0, help="With --recording: whose seat.")] = 0,
    out: Annotated[Path, typer.Option(help="The file.")] = Path("demonstrations.npz"),
    as_json: AsJson = False,
) -> None:
    """Record what a driver sees and does: `race demonstrate raceline --noise 0.1 --out laps.npz`.

    Or take it from a race that anybody drove: `race demonstrate --recording FILE --seat 2`.
    Learn from it: `race train time-trial --set warm_start.demonstrations=laps.npz`.
    """
    names = names_in(tracks)
    if not names:
        raise ScenarioError(f"--tracks {tracks!r}: name one track or more")
    if bool(driver) == (recording is not None):
        raise ScenarioError(f"driver {driver!r}, --recording {recording}: give one of the two")
    if not out.parent.is_dir():
        raise ScenarioError(f"--out {out}: there is no folder {out.parent}")
    with brought_by("train"):
        from race_agents.training.demonstrations import write_demonstrations
        from race_agents.training.demonstrator import demonstrate as watch
        from race_agents.training.recorded import demonstrations_in
    if recording is not None:
        shown, drive = demonstrations_in(recording, seat)
        driven, contacts = drive.laps, drive.wall_contacts
    else:
        shown, runs = watch(driver, names, vehicle, laps, seed, noise)
        driven, contacts = laps, sum(run.crashes for run in runs)
    write_demonstrations(out, shown)
    if as_json:
        count = len(shown.observations)
        print_document({"file": str(out), "decisions": count, "wall_contacts": contacts})
        return
    Console(stderr=True).print(
        f"{out}: {len(shown.observations)} decisions of {shown.about.driver} in {driven} laps on "
        f"{', '.join(shown.about.tracks)}, with {contacts} wall contacts",
        markup=False,
        soft_wrap=True,
    )
