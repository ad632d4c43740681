"""`race train`: a policy learns to drive, and leaves a folder with everything behind."""

import json
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from race_server.cli.document import AsJson, print_document
from race_server.errors import ScenarioError, brought_by

if TYPE_CHECKING:
    from race_agents.training.callback import News
    from race_agents.training.run import Outcome
    from race_agents.training.settings import Settings

BESIDE_BAR = 17  # characters: share, time that remains, and what is between columns


def train(
    preset: Annotated[
        str,
        typer.Argument(
            help="time-trial, time-trial-ppo, race, full, report-b, or a .toml file of settings."
        ),
    ] = "",
    track_set: Annotated[
        str, typer.Option(help="A named set: train, train-narrow, train-few, …")
    ] = "",
    tracks: Annotated[str, typer.Option(help="Comma-separated names, instead of a set.")] = "",
    minutes: Annotated[float | None, typer.Option(help="Learn for so long, in all.")] = None,
    steps: Annotated[int | None, typer.Option(help="Learn for so many decisions, in all.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of worlds and network.")] = None,
    algorithm: Annotated[str, typer.Option(help="ppo, sac, td3 or dqn.")] = "",
    worlds: Annotated[int | None, typer.Option(help="Races at once.")] = None,
    threads: Annotated[int | None, typer.Option(help="Cores to spread the worlds over.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the run; otherwise one of the user's runs.")
    ] = None,
    resume: Annotated[str, typer.Option(help="Go on with a run: its name or its folder.")] = "",
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", help="key=value of the settings, such as reward.crash=-3."),
    ] = None,
    tensorboard: Annotated[
        bool, typer.Option("--tensorboard", help="Write a log for TensorBoard, too.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Let a policy learn to drive: `race train time-trial --minutes 5`."""
    with brought_by("train"):
        from race_agents.training import folder
        from race_agents.training.run import train as train_it
        from race_agents.training.settings_toml import read_settings
    words = _words(track_set, tracks, minutes, steps, seed, algorithm, worlds, threads)
    words += changes or []
    console = Console(stderr=True)
    if tensorboard:
        with brought_by("curves"):
            import_module("tensorboard")
    if resume:
        _check_resumed(resume, preset, out)
        place = _run_folder(resume)
        settings = folder.settings_in(place, tuple(words))
    else:
        if not preset:
            raise ScenarioError("name a preset or a .toml file, such as `race train time-trial`")
        settings = read_settings(preset, words)
        place = folder.new_folder(Path(preset).stem, out)
    console.print(f"run: {place}", markup=False, soft_wrap=True)
    with (
        _disk_named(place),
        folder.occupied(place),
        nullcontext() if resume else _left_clean(place),
        _bar(settings, console, quiet=as_json) as tell,
        warnings.catch_warnings(),
    ):
        warnings.filterwarnings("ignore", module="stable_baselines3")
        outcome = train_it(
            settings,
            place,
            resume=bool(resume),
            tell=tell,
            say=lambda text: console.print(text, markup=False, soft_wrap=True),
            tensorboard=tensorboard,
        )
    _show(outcome, settings, console, as_json=as_json)
    if outcome.stopped:
        sys.exit(130)


def _check_resumed(resume: str, preset: str, out: Path | None) -> None:
    """Refuse what a run that goes on would not heed."""
    for given in (preset, f"--out {out}" if out is not None else ""):
        if given:
            raise ScenarioError(
                f"--resume {resume} goes on with that run's own settings in its own folder: leave "
                f"out {given}; --set changes a setting"
            )


def _words(
    track_set: str,
    tracks: str,
    minutes: float | None,
    steps: int | None,
    seed: int | None,
    algorithm: str,
    worlds: int | None,
    threads: int | None,
) -> list[str]:
    """Return options of the command line as changes of settings."""
    if minutes is not None and steps is not None:
        raise ScenarioError(f"--minutes {minutes:g} and --steps {steps}: give one of the two")
    words: list[str] = []
    if track_set or tracks:
        names = [name.strip() for name in tracks.split(",") if name.strip()]
        words += [f"tracks.set={json.dumps(track_set)}", f"tracks.names={json.dumps(names)}"]
        # Stages of a preset name tracks of its own set.
        words.append("curriculum=[]")
    if minutes is not None:
        words += ["steps=none", f"minutes={minutes}"]
    if steps is not None:
        words += ["minutes=none", f"steps={steps}"]
    if algorithm:
        words += [f"algorithm.name={algorithm}"]
    numbers: dict[str, Any] = {"seed": seed, "worlds": worlds, "threads": threads}
    return words + [f"{name}={value}" for name, value in numbers.items() if value is not None]


def _run_folder(name: str) -> Path:
    from race_agents.policies.registry import runs_folder

    place = Path(name).expanduser()
    return place if place.is_dir() else runs_folder() / name


@contextmanager
def _left_clean(place: Path) -> Iterator[None]:
    """Leave no folder behind where settings make no training."""
    from race_agents.training import folder

    try:
        yield
    finally:
        with suppress(OSError):
            folder.abandon(place)


@contextmanager
def _disk_named(place: Path) -> Iterator[None]:
    """Say in a sentence what a full or locked disk did to a training."""
    try:
        yield
    except OSError as error:
        raise ScenarioError(
            f"{error.filename or place}: {error.strerror or error}; the training is off; where it "
            "left a latest.pt, --resume goes on"
        ) from error


@contextmanager
def _bar(
    settings: "Settings", console: Console, *, quiet: bool
) -> Iterator[Callable[["News"], None]]:
    """Show how far a training is and how it goes."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
    from rich.table import Column

    # On a narrow terminal rather the last figures go than the bar and the time.
    length = min(40, console.width // 5)
    words = Column(no_wrap=True, max_width=max(console.width - length - BESIDE_BAR, 12))
    columns = (
        TextColumn("{task.description}", markup=False, table_column=words),
        BarColumn(length),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
    )
    hidden = quiet or not console.is_terminal
    with Progress(*columns, console=console, disable=hidden) as bar:
        task = bar.add_task(settings.title or "training", total=1.0)

        def tell(news: "News") -> None:
            bar.update(task, completed=news.share, description=_words_of(news))
            if news.marks is not None and not quiet:
                console.print(
                    f"{100.0 * news.share:3.0f} %, {news.steps} decisions; {_words_of(news)}; "
                    f"validation: {_marks_in_words(news.marks)}",
                    markup=False,
                    soft_wrap=True,
                )

            if news.ratings and not quiet:
                console.print(f"ratings: {_ratings_in_words(news)}", markup=False, soft_wrap=True)

        yield tell


def _words_of(news: "News") -> str:
    reward = "–" if news.reward is None else f"{news.reward:.1f}"
    crashes = "–" if news.crash_rate is None else f"{100.0 * news.crash_rate:.0f} %"
    lap = "–" if news.best_lap_s is None else f"{news.best_lap_s:.2f} s"
    figures = f"return {reward}, lap {lap}, crashes {crashes}, {news.steps_per_s:.0f} steps/s"
    return ": ".join(word for word in (news.stage, news.method, figures) if word)


def _ratings_in_words(news: "News") -> str:
    return ", ".join(f"{one.driver} {one.mu:.1f} ± {2.0 * one.sigma:.1f}" for one in news.ratings)


def _marks_in_words(marks: Any) -> str:
    lap = "no lap" if marks.best_lap_s is None else f"best lap {marks.best_lap_s:.2f} s"
    return f"{marks.speed:.2f} m/s, {100.0 * marks.crash_rate:.0f} % crash, {lap}"


def _show(outcome: "Outcome", settings: "Settings", console: Console, *, as_json: bool) -> None:
    if as_json:
        print_document(
            {
                "run": outcome.folder.name,
                "folder": str(outcome.folder),
                "stopped": outcome.stopped,
                **outcome.evaluation,
            }
        )
        return
    from rich.table import Table

    from race_agents.training.folder import ways_to_drive

    known = ", ".join(outcome.evaluation["learned_on"])
    title = "the best policy on unseen courses" + (f", but it learned on {known}" if known else "")
    table = Table("track", title=title, title_justify="left")
    for column in ("speed, m/s", "crash rate", "laps", "best lap, s", "return"):
        table.add_column(column, justify="right")
    for row in outcome.evaluation["tracks"]:
        lap = "–" if row["best_lap_s"] is None else f"{row['best_lap_s']:.3f}"
        figures = (f"{row['speed']:.2f}", f"{row['crash_rate']:.2f}", f"{row['laps']:.1f}")
        table.add_row(row["track"], *figures, lap, f"{row['reward']:.1f}")
    Console().print(table)
    alone, _ = ways_to_drive(outcome.folder, settings)
    console.print(f"drive it: {alone}", markup=False, soft_wrap=True)
