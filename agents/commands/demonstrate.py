"""`race demonstrate`: record laps of a driver as training data."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_server.cli.document import AsJson, print_document
from race_server.cli.options import MOST_LAPS, names_in, refuse_options
from race_server.core.seeds import MOST_SEED
from race_server.errors import ScenarioError, brought_by
from race_server.kept_file import check_place
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_agents.training.demonstrations import Demonstrations


# Options of laps that are driven now.
_OF_DRIVING = ("tracks", "laps", "vehicle", "seed", "noise")


def demonstrate(
    context: typer.Context,
    driver: Annotated[
        str, typer.Argument(help="Installed driver, such as raceline; not with --recording.")
    ] = "",
    tracks: Annotated[
        str, typer.Option("--tracks", "--track", help="Comma-separated names of tracks.")
    ] = "covapsy-train-2023",
    laps: Annotated[int, typer.Option(min=1, max=MOST_LAPS, help="Laps on each track.")] = 5,
    vehicle: Annotated[
        str,
        typer.Option(
            help="Vehicle: tt02, tt02-drift, kart-13, kart-30, kart-60, car; an unknown name "
            "lists all."
        ),
    ] = "tt02",
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Seed of sensors, start and noise.")
    ] = 1,
    noise: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            help="Deviation of the noise added to pedals and steering, which the driver corrects.",
        ),
    ] = 0.0,
    recording: Annotated[
        Path | None,
        typer.Option(
            help="Take the laps from this recording (.mcap file) instead of driving them."
        ),
    ] = None,
    seat: Annotated[int, typer.Option(min=0, help="With --recording: number of the seat.")] = 0,
    out: Annotated[Path, typer.Option(help="File to write (.npz).")] = Path("demonstrations.npz"),
    as_json: AsJson = False,
) -> None:
    """Record observations and actions of a driver as demonstrations.

    From laps driven now: `race demonstrate raceline --noise 0.1 --out laps.npz`.
    From a recorded race: `race demonstrate --recording FILE --seat 2`.
    To learn from the file: `race train time-trial --set warm_start.demonstrations=laps.npz`.
    """
    names = names_in(tracks)
    if not names:
        raise ScenarioError(f"--tracks {tracks!r}: name one track or more")
    if bool(driver) == (recording is not None):
        raise ScenarioError(f"driver {driver!r}, --recording {recording}: give one of the two")
    if recording is not None:
        _refuse_driving(context)
    check_place(out)
    if recording is not None and out.resolve() == recording.resolve():
        raise ScenarioError(
            f"--out {out}: is the recording, which would be lost; name another file"
        )
    with brought_by("train"):
        from race_agents.training.demonstrations import write_demonstrations
        from race_agents.training.demonstrator import demonstrate as drive_laps
        from race_agents.training.recorded import demonstrations_in
    if recording is not None:
        shown, recorded = demonstrations_in(recording, seat)
        driven, contacts = recorded.laps, recorded.wall_contacts
    else:
        shown, runs = drive_laps(driver, names, vehicle, laps, seed, noise)
        driven = sum(len(run.laps) for run in runs)
        contacts = sum(run.crashes for run in runs)
    write_demonstrations(out, shown)
    _show(out, shown, driven, contacts, as_json=as_json)


def _refuse_driving(context: typer.Context) -> None:
    """Raise an error where an option of driving stands beside a recording."""
    why = (
        "is of laps driven now, and --recording takes those of a recording; leave one of the two "
        "out"
    )
    refuse_options(context, _OF_DRIVING, why)


def _show(out: Path, shown: "Demonstrations", laps: int, contacts: int, *, as_json: bool) -> None:
    """Print what was recorded: on stderr, or as one document."""
    decisions = len(shown.observations)
    if as_json:
        print_document({"file": str(out), "decisions": decisions, "wall_contacts": contacts})
        return
    Console(stderr=True).print(
        f"{out}: {decisions} decisions of {shown.about.driver} in {laps} laps on "
        f"{', '.join(shown.about.tracks)}, with {contacts} wall contacts",
        soft_wrap=True,
    )
