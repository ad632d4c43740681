"""The folder of a training run."""

import fcntl
import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from race_agents.policies.registry import CONFIG, EVALUATION, POLICY, name_of, runs_folder
from race_agents.training.evaluation import Marks
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import as_toml, read_settings
from race_agents.training.tasks import final_courses
from race_server.errors import ScenarioError
from race_server.kept_file import write_together
from race_server.scenario.track.sets import REVERSED

VERSIONS, README = "versions.json", "README.md"
PACKAGES = ("race-server", "torch", "stable-baselines3", "numpy", "numba", "gymnasium", "onnx")
MOST_RUNS = 10_000


def new_folder(name: str, wanted: Path | None) -> Path:
    """Make and return the folder of a new run: the given one, or the next of its name.

    Raises:
        ScenarioError: it cannot be made, or holds a run already.
    """
    if wanted is not None:
        places = [wanted]
    else:
        places = [runs_folder() / f"{name}-{number}" for number in range(1, MOST_RUNS)]
    for place in places:
        if (place / CONFIG).exists() or (wanted is None and place.exists()):
            continue
        try:
            place.mkdir(parents=True, exist_ok=wanted is not None)
        except OSError as error:
            if wanted is None and place.is_dir():
                continue  # another training has just created it
            raise ScenarioError(f"{place}: cannot be made: {error.strerror}") from error
        return place
    raise ScenarioError(
        f"{places[0]} holds a run already; continue it with --resume, or choose another"
    )


@contextmanager
def occupied(folder: Path) -> Iterator[None]:
    """Lock the folder of a run against other trainings; the lock leaves no file.

    Raises:
        ScenarioError: another training uses it.
    """
    place = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ScenarioError(
                f"{folder}: another training uses it; wait for its end, or choose another"
            ) from error
        yield
    finally:
        os.close(place)


def abandon(folder: Path) -> None:
    """Remove what `begin` wrote, and the folder, if nothing was learned."""
    found = list(folder.iterdir())
    if {path.name for path in found} <= {CONFIG, VERSIONS}:
        for path in found:
            path.unlink()
        folder.rmdir()


def begin(folder: Path, settings: Settings) -> None:
    """Write the settings and versions of a run before it begins."""
    # Whole or not at all: without its settings no run goes on.
    write_together(
        {folder / CONFIG: as_toml(settings).encode(), folder / VERSIONS: _json_of(versions())}
    )


@contextmanager
def begun(folder: Path, settings: Settings, has_learned: Callable[[], bool]) -> Iterator[None]:
    """Begin a run, or go on with it under other settings.

    If that fails before anything was learned under them, those before are put back.
    """
    places = (folder / CONFIG, folder / VERSIONS)
    before = {path: path.read_bytes() for path in places if path.is_file()}
    begin(folder, settings)
    try:
        yield
    except BaseException:
        if not has_learned():
            write_together(before)
        raise


def settings_in(folder: Path, changes: tuple[str, ...] = ()) -> Settings:
    """Return the settings of a run, with changes.

    Raises:
        ScenarioError: the folder holds no run.
    """
    if not (folder / CONFIG).is_file():
        raise ScenarioError(f"{folder} holds no run: it has no {CONFIG}")
    return read_settings(str(folder / CONFIG), changes)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that affect the result."""
    found = {"python": sys.version.split()[0]}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def evaluation_of(marks: list[Marks], more: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of the best policy as plain data."""
    return {marks[-1].courses: [one.row() for one in marks], **more}


def write_evaluation(folder: Path, document: dict[str, Any]) -> None:
    """Write the figures of the best policy: the last file of a run, after all others."""
    write_together({folder / EVALUATION: _json_of(document)})


def _json_of(document: dict[str, Any]) -> bytes:
    return (json.dumps(document, indent=2) + "\n").encode()


def write_readme(
    folder: Path, settings: Settings, marks: list[Marks], evaluation: dict[str, Any]
) -> None:
    """Write a page on how to repeat a run, with its results."""
    again, more = _again(folder, settings, evaluation)
    ways = "\n".join(f"    {way}" for way in ways_to_drive(folder, settings))
    text = f"""# {settings.title or folder.name}

Learned by {settings.algorithm.name} in {evaluation["steps"]} decisions and \
{evaluation["minutes"]:.1f} minutes, seed {settings.seed}.

Do it again, in this folder, {_likeness(settings, evaluation)}:

    {again}

Continue it, until it has learned for twice as long in all:

    {more}

Drive it:

{ways}

{_exam_words(settings)}

{_table(marks)}

{POLICY} answers like the learner to {evaluation["parity"]:.1e} and takes \
{evaluation["decision_us"]:.0f} µs for a decision.
"""
    write_together({folder / README: text.encode()})


def _again(folder: Path, settings: Settings, evaluation: dict[str, Any]) -> tuple[str, str]:
    """Return the commands that do a run again, and that continue it."""
    if "learned_with" not in evaluation:
        run, more = name_of(folder), _twice(settings)
        return f"race train {CONFIG}", f"race train --resume {shlex.quote(run)} {more}"
    # With the settings of all that learned together, which stand above this folder.
    whole = folder.absolute().parent
    more = "--steps N" if settings.steps is not None else _twice(settings)
    return (
        f"race train {Path('..') / CONFIG}",
        f"race train --resume {shlex.quote(name_of(whole))} {more}",
    )


def _exam_words(settings: Settings) -> str:
    """Return a text on how the best policy was evaluated."""
    seeds = settings.evaluation.seeds
    if settings.parks:
        return (
            f"The best policy in each lot, under {seeds} seeds that neither learned from nor chose "
            "it. Shares are of all episodes, with intervals of 95 % (Wilson); the time is the "
            "median of those that parked:"
        )
    return (
        f"The best policy on each of the courses of `evaluation.final`, under {seeds} seeds from "
        "the start grid. The speed is that along the centre line until "
        f"{settings.evaluation.seconds:g} s or the race are over; a kart that crashed stands until "
        "then:"
    )


def _table(marks: list[Marks]) -> str:
    heads = (marks[-1].courses.removesuffix("s"), *marks[-1].heads)
    rows = [(one.course, *one.cells()) for one in marks]
    lines = [heads, ("---",) * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def ways_to_drive(folder: Path, settings: Settings) -> tuple[str, ...]:
    """Return the commands that drive a run's policy, the shortest first."""
    if settings.parks:
        name, lot = name_of(folder), shlex.quote(settings.parking.lots[0])
        exam = f"race exam parking --drivers {shlex.quote(f'learned:{name}')} --lot {lot}"
        return f"{exam} --vehicle {settings.vehicle}", f"race policy check {shlex.quote(name)}"
    driver = shlex.quote(f"learned:{name_of(folder)}")
    courses = [name for name in final_courses(settings) if not name.endswith(REVERSED)]
    # Without options both take the 1/10 car, and a course that is wide enough for it.
    own = settings.vehicle != Settings.model_fields["vehicle"].default
    vehicle = f" --vehicle {settings.vehicle}" if own else ""
    track = shlex.quote(courses[0]) if courses else ""
    alone = f" --tracks {track}" if track else ""
    among = f" --track {track}" if track and own else ""
    return (
        f"race trial --drivers {driver}{alone}{vehicle}",
        f"race start --drivers {driver},follow_gap --karts 4{among}{vehicle}",
    )


def _likeness(settings: Settings, evaluation: dict[str, Any]) -> str:
    """Return how exact a repetition is: a clock never ends a training at the same decision."""
    if evaluation["stopped"] or evaluation["resumed"]:
        return "without interruption: this run was interrupted, so the policy will differ"
    if settings.steps is not None:
        return f"to the bit with the versions in {VERSIONS}"
    return "as far as a clock allows; with --steps it is the same to the bit"


def _twice(settings: Settings) -> str:
    if settings.steps is not None:
        return f"--steps {2 * settings.steps}"
    return f"--minutes {2.0 * (settings.minutes or 0.0):g}"
