"""`race track survey`: a course file from the sensors of a drive."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_server.cli.document import AsJson, print_document
from race_server.cli.drill_report import progress
from race_server.errors import RecordingError, TrackError, brought_by
from race_server.kept_file import check_place, write_together
from race_server.terminal import say

if TYPE_CHECKING:
    from race_agents.planning.drive_survey import SensorLog
    from race_agents.training.demonstrations import Demonstrations
    from race_server.core.vehicles import Vehicle

RACE = ".mcap"
# Parts of an observation that a course is made of.
PARTS = ("lidar", "speed", "yaw_rate")


def survey(
    drive: Annotated[
        Path,
        typer.Argument(
            help="Recording of a race (.mcap), or of laps by `race demonstrate` (.npz)."
        ),
    ],
    to: Annotated[Path, typer.Option("--to", help="Course file to write (.toml).")],
    seat: Annotated[int, typer.Option(min=0, help="Of a race: number of the seat.")] = 0,
    title: Annotated[str, typer.Option(help="Title. Default: the name of the course file.")] = "",
    as_json: AsJson = False,
) -> None:
    """Make a course file of a drive: of its lidar, its speed and its yaw rate, and nothing else.

    The drive must come back to where it began, with walls in the lidar's reach on both sides.
    """
    from race_agents.planning.drive_survey import survey_drive
    from race_server.scenario.track.importers import check_no_map, line_file
    from race_server.scenario.track.load import course_in

    if to.suffix != ".toml":
        raise TrackError(f"{to}: write the course as .toml")
    check_place(to)
    check_no_map(to)
    log, vehicle = sensor_log(drive, seat)
    with progress(f"surveying {drive.name}", 100) as bar:
        found = survey_drive(log, vehicle, lambda share: bar(100.0 * share))
    origin = f"Surveyed from {drive.name}"
    words = line_file(found.points, origin, found.scale, title or to.stem).encode()
    course = course_in(to.stem, to.name, words)
    try:
        write_together({to: words})
    except OSError as error:
        raise TrackError(f"{to}: cannot be written: {error.strerror}") from error
    if as_json:
        figures = {"length_m": course.length, "width_min_m": course.width_min}
        figures |= {"width_mean_m": course.width_mean, "width_max_m": course.width_max}
        figures |= {"scans": found.scans, "driven_m": found.driven_m, "closing_m": found.closing_m}
        rounded = {name: round(value, 3) for name, value in figures.items()}
        print_document({"file": str(to), "scale": found.scale} | rounded)
        return
    say(f"{to}: {course.length:.1f} m, {course.width_min:.2f} to {course.width_max:.2f} m wide")
    say(
        f"from {found.scans} scans on {found.driven_m:.1f} m; the lap closed with "
        f"{found.closing_m:.2f} m of error, which is spread over it"
    )


def sensor_log(drive: Path, seat: int) -> "tuple[SensorLog, Vehicle]":
    """Return what the sensors of a recorded drive measured, and which vehicle drove.

    A race is simulated again with all sensors on the kart of the seat.

    Raises:
        RecordingError: the file is damaged, or holds no single drive.
    """
    with brought_by("train"):
        from race_agents.training.demonstrations import read_demonstrations
        from race_agents.training.recorded import demonstrations_in

    is_race = drive.suffix == RACE
    shown = demonstrations_in(drive, seat)[0] if is_race else read_demonstrations(drive)
    if len(shown.about.tracks) > 1:
        tracks = ", ".join(shown.about.tracks)
        raise RecordingError(f"{drive}: drives on {tracks}; record them one by one")
    missing = [name for name in PARTS if name not in shown.about.parts]
    if missing:
        raise RecordingError(f"{drive}: it does not show {', '.join(missing)}; record another one")
    return sensor_log_of(shown)


def sensor_log_of(shown: "Demonstrations") -> "tuple[SensorLog, Vehicle]":
    """Return what the sensors measured in a demonstration, and which vehicle drove."""
    from race_agents.planning.drive_survey import SensorLog
    from race_server.core.observation import layout_of
    from race_server.core.vehicle_presets import vehicle_named

    about = shown.about
    slices = layout_of(about.parts, about.lidar_rays).slices
    seen = shown.observations.astype("f8")
    log = SensorLog(
        ranges=seen[:, slices["lidar"]],
        speed=seen[:, slices["speed"].start],
        yaw_rate=seen[:, slices["yaw_rate"].start],
        step_s=about.decision_s,
        field=about.lidar_field,
        reach=about.lidar_reach,
    )
    return log, vehicle_named(about.vehicle)
