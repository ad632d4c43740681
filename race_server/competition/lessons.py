"""Lessons from laps that were driven: by a driver alone on a course, or in a recorded race."""

from collections.abc import Callable
from pathlib import Path

from race_server.coaching.circumstances import Circumstances
from race_server.coaching.lap import Lap, lap_on
from race_server.coaching.lesson import Coach, Lesson
from race_server.competition.recorded_laps import recorded_laps
from race_server.competition.time_trial.lap import TrialLap
from race_server.competition.time_trial.run import drive_run
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.vehicle_presets import vehicle_named
from race_server.core.vehicles import Vehicle
from race_server.errors import RecordingError, ScenarioError
from race_server.scenario.track.course import Course
from race_server.scenario.track.load import load_course
from race_server.storage.recording.reader import read_recording


def lesson_of_driver(spec: RunSpec) -> Lesson:
    """Let a driver lap alone, and return what its laps teach.

    Raises:
        RaceError: the course or the vehicle does not exist.
        ScenarioError: the driver completed no lap.
    """
    course = load_course(spec.track)
    run = drive_run(spec)
    if not run.laps:
        raise ScenarioError(
            f"{spec.driver} completed no lap of {spec.track}: {run.remark or 'it was stopped'}"
        )
    laps = [_studied(course, lap, Circumstances(lap.is_flying, lap.is_clean)) for lap in run.laps]
    return Coach(course, vehicle_named(spec.vehicle), solve=True).lesson(spec.driver, laps)


def lessons_of_recording(
    path: Path, only: str = "", warn: Callable[[str], None] = lambda _: None
) -> dict[int, Lesson]:
    """Return what a recorded race teaches its drivers, by seat. only: one of them, by name.

    warn: is told why laps are missing, if some are.

    Raises:
        RecordingError: it cannot be read, or no driver of that name completed a lap.
    """
    found = recorded_laps(read_recording(path))
    if found.remark:
        warn(found.remark)
    course, lessons, coaches = found.scenario.course, {}, dict[Vehicle, Coach]()
    for seat in sorted({one.seat for one in found.laps}):
        own = [one for one in found.laps if one.seat == seat]
        if only and own[0].driver != only:
            continue
        laps = [_studied(course, one.lap, one.circumstances) for one in own]
        vehicle = found.scenario.vehicle_of(seat)
        if vehicle not in coaches:
            coaches[vehicle] = Coach(course, vehicle)
        lessons[seat] = coaches[vehicle].lesson(own[0].driver, laps)
    if not lessons:
        names = ", ".join(dict.fromkeys(one.driver for one in found.laps)) or "none"
        raise RecordingError(
            f"recording {path}: no lap of {only or 'any driver'}; drivers with laps: {names}"
        )
    return lessons


def _studied(course: Course, lap: TrialLap, told: Circumstances) -> tuple[int, Lap, str]:
    return lap.number, lap_on(course, f"lap {lap.number}", lap.time_us, lap.columns), told.reason
