"""The folder that a run of training leaves behind."""

import json
import sys
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from agents.policies.shelf import CONFIG, EVALUATION, POLICY, name_of, runs_folder
from agents.training.evaluation import Marks
from agents.training.settings import Settings
from agents.training.sheet import as_toml, read_settings
from race_server.errors import ScenarioError

VERSIONS, README = "versions.json", "README.md"
PACKAGES = ("race-server", "torch", "stable-baselines3", "numpy", "numba", "gymnasium", "onnx")
MOST_RUNS = 10_000


def new_folder(name: str, wanted: Path | None) -> Path:
    """Make and return the folder of a new run: the one that is wanted, or the next of its name.

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
            place.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ScenarioError(f"{place}: cannot be made: {error.strerror}") from error
        return place
    raise ScenarioError(f"{places[0]} holds a run already; go on with --resume, or choose another")


def begin(folder: Path, settings: Settings) -> None:
    """Write what a run is before it begins."""
    (folder / CONFIG).write_text(as_toml(settings), encoding="utf-8")
    _write_json(folder / VERSIONS, versions())


def settings_in(folder: Path, changes: tuple[str, ...] = ()) -> Settings:
    """Return the settings of a run, with changes.

    Raises:
        ScenarioError: the folder holds no run.
    """
    if not (folder / CONFIG).is_file():
        raise ScenarioError(f"{folder} holds no run: it has no {CONFIG}")
    return read_settings(str(folder / CONFIG), changes)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that decide what is learned."""
    found = {"python": sys.version.split()[0]}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def write_evaluation(folder: Path, marks: list[Marks], more: dict[str, Any]) -> dict[str, Any]:
    """Write and return how the best policy does."""
    document = {"tracks": [asdict(one) for one in marks], **more}
    _write_json(folder / EVALUATION, document)
    return document


def _write_json(path: Path, document: dict[str, Any]) -> None:
    path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def write_readme(folder: Path, settings: Settings, evaluation: dict[str, Any]) -> None:
    """Write how to repeat a run and what came of it."""
    rows = [
        f"| {row['track']} | {row['speed']:.2f} | {row['crash_rate']:.2f} | {_lap(row)} |"
        for row in evaluation["tracks"]
    ]
    text = f"""# {settings.title or folder.name}

Learned by {settings.algorithm.name} in {evaluation["steps"]} decisions and \
{evaluation["minutes"]:.1f} minutes, seed {settings.seed}.

Do it again, {_likeness(settings, evaluation)}:

    race train {CONFIG}

Go on with it, until it has learned for twice as long in all:

    race train --resume {name_of(folder)} {_twice(settings)}

Drive it:

    race trial --drivers learned:{name_of(folder)} --tracks covapsy-test-2023
    race start --drivers learned:{name_of(folder)},follow_gap --karts 4

The best policy, tried out on {settings.evaluation.seeds} seeds from the start grid:

| track | speed [m/s] | crash rate | best lap [s] |
|---|---|---|---|
{chr(10).join(rows)}

{POLICY} answers like the learner to {evaluation["parity"]:.1e} and takes \
{evaluation["decision_us"]:.0f} µs for a decision.
"""
    (folder / README).write_text(text, encoding="utf-8")


def _likeness(settings: Settings, evaluation: dict[str, Any]) -> str:
    """Return how much alike a repetition is: a clock never stops a training at the same place."""
    if evaluation["stopped"] or evaluation["resumed"]:
        return "at one go: this run was interrupted, so another policy comes out"
    if settings.steps is not None:
        return f"to the bit with the versions in {VERSIONS}"
    return "as far as a clock allows; with --steps it is the same to the bit"


def _twice(settings: Settings) -> str:
    if settings.steps is not None:
        return f"--steps {2 * settings.steps}"
    return f"--minutes {2.0 * (settings.minutes or 0.0):g}"


def _lap(row: dict[str, Any]) -> str:
    return "–" if row["best_lap_s"] is None else f"{row['best_lap_s']:.2f}"
