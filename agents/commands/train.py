"""`race train`: train a policy, and keep everything of the run in one folder."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from race_server.cli.document import AsJson, print_document
from race_server.cli.option_fields import expand_options
from race_server.cli.options import names_in
from race_server.errors import ScenarioError, brought_by
from race_server.terminal import Console, TextColumn

if TYPE_CHECKING:
    from race_agents.training.callback import TrainingProgress
    from race_agents.training.far_ppo import Crew
    from race_agents.training.run import TrainingResult
    from race_agents.training.settings import Settings

BESIDE_BAR = 17  # characters: share, remaining time, and the space between columns


@dataclass(frozen=True)
class TrainOptions:
    """All arguments and options of `race train`."""

    preset: Annotated[
        str,
        typer.Argument(
            help="time-trial, time-trial-any, time-trial-kart, time-trial-ppo, race, full, "
            "two-teams, report-b, parking-1, parking-2, parking-2-end, parking-2-karts, park, "
            "park-kerb, park-gate, park-lorry, park-rows, report-a, trailer-report-c, or a .toml "
            "file of settings."
        ),
    ] = ""
    track_set: Annotated[
        str,
        typer.Option(
            help="Named set of tracks: train, train-narrow, train-few, … Default: the preset's."
        ),
    ] = ""
    tracks: Annotated[
        str, typer.Option(help="Comma-separated names of tracks, instead of a set.")
    ] = ""
    lots: Annotated[
        str, typer.Option(help="Comma-separated names of lots to park in. Default: the preset's.")
    ] = ""
    minutes: Annotated[
        float | None,
        typer.Option(help="Total minutes of training; not with --steps. Default: the preset's."),
    ] = None
    steps: Annotated[
        int | None,
        typer.Option(
            help="Total decisions to train on, rounded up to whole rollouts; not with --minutes. "
            "Default: the preset's."
        ),
    ] = None
    seed: Annotated[
        int | None, typer.Option(help="Seed of worlds and network. Default: the preset's.")
    ] = None
    simulator: Annotated[
        str,
        typer.Option(
            help="Simulator that moves the vehicles: highway-env. Default: the preset's, our own."
        ),
    ] = ""
    algorithm: Annotated[
        str, typer.Option(help="ppo, ppo-sb3, mappo, poca, sac, td3 or dqn. Default: the preset's.")
    ] = ""
    worlds: Annotated[
        int | None, typer.Option(help="Races that run in parallel. Default: the preset's.")
    ] = None
    threads: Annotated[
        int | None, typer.Option(help="Threads that step the worlds. Default: the preset's.")
    ] = None
    ray: Annotated[
        str,
        typer.Option(
            help="Address of a Ray cluster whose machines run the races, such as 10.0.0.5:6379; "
            "local: a cluster of this machine's cores."
        ),
    ] = ""
    runners: Annotated[
        int,
        typer.Option(min=0, help="With --ray: runners that share the worlds. 0: as many as fit."),
    ] = 0
    out: Annotated[
        Path | None, typer.Option(help="New folder for the run. Default: one in the user's runs.")
    ] = None
    resume: Annotated[
        str, typer.Option(help="Continue a run: its name or its folder. Takes no preset.")
    ] = ""
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="Change a setting: key=value, such as reward.crash=-3; may be repeated."
        ),
    ] = None
    tensorboard: Annotated[
        bool, typer.Option("--tensorboard", help="Also write a log for TensorBoard.")
    ] = False
    as_json: AsJson = False


@expand_options
def train(options: TrainOptions) -> None:
    """Train a policy to drive or to park: `race train time-trial --minutes 5`."""
    with brought_by("train"):
        from race_agents.training import folder
        from race_agents.training.learner import without_warnings
        from race_agents.training.run import train as train_one
        from race_agents.training.together import train_together
    console = Console(stderr=True)
    if options.tensorboard:
        with brought_by("curves"):
            import_module("tensorboard")
    settings, place = _settings(options)
    console.print(f"run: {place}", soft_wrap=True)
    with (
        _disk_named(place),
        folder.occupied(place),
        nullcontext() if options.resume else _left_clean(place),
        _bar(settings, console) as tell,
        without_warnings(),
    ):
        options_of_run: dict[str, Any] = {
            "resume": bool(options.resume),
            "tell": tell,
            "say": lambda text: console.print(text, soft_wrap=True),
            "tensorboard": options.tensorboard,
        }
        if options.ray:
            with _crew(options, settings) as crew:
                outcomes = [train_one(settings, place, crew=crew, **options_of_run)]
        elif settings.policies:
            outcomes = train_together(settings, place, **options_of_run)
        else:
            outcomes = [train_one(settings, place, **options_of_run)]
    _show(outcomes, settings, console, as_json=options.as_json)
    if any(outcome.stopped for outcome in outcomes):
        sys.exit(130)


@contextmanager
def _crew(options: TrainOptions, settings: "Settings") -> Iterator["Crew"]:
    """Let runners of a cluster collect what is learned from."""
    with brought_by("ray"):
        from race_agents.training.ray_crew import RayCrew
    from race_agents.training.far_ppo import check_far

    check_far(settings)
    crew = RayCrew(settings, options.ray, options.runners)
    try:
        yield crew
    finally:
        crew.close()


def _settings(options: TrainOptions) -> tuple["Settings", Path]:
    """Return the settings and the folder of a run: of a new one, or of one that continues.

    Raises:
        ScenarioError: options contradict each other, or a setting is wrong.
    """
    from race_agents.policies.registry import run_folder
    from race_agents.training import folder
    from race_agents.training.settings_toml import read_settings

    changes = _changes(options)
    if options.resume:
        _check_resumed(options.resume, options.preset, options.out)
        place = run_folder(options.resume)
        return folder.settings_in(place, tuple(changes)), place
    if not options.preset:
        raise ScenarioError("name a preset or a .toml file, such as `race train time-trial`")
    settings = read_settings(options.preset, changes)
    return settings, folder.new_folder(Path(options.preset).stem, options.out)


def _check_resumed(resume: str, preset: str, out: Path | None) -> None:
    """Refuse options that a resumed run would ignore."""
    for given in (preset, f"--out {out}" if out is not None else ""):
        if given:
            raise ScenarioError(
                f"--resume {resume} continues with the settings and the folder of that run: leave "
                f"out {given}; --set changes a setting"
            )


def _changes(options: TrainOptions) -> list[str]:
    """Return the options of the command line as changes of settings."""
    minutes, steps = options.minutes, options.steps
    if minutes is not None and steps is not None:
        raise ScenarioError(f"--minutes {minutes:g} and --steps {steps}: give one of the two")
    changes: list[str] = []
    if options.track_set or options.tracks:
        names = list(names_in(options.tracks))
        changes += [f"tracks.set={json.dumps(options.track_set)}"]
        changes += [f"tracks.names={json.dumps(names)}"]
        # Stages of a preset name tracks of the preset's set.
        changes.append("curriculum=[]")
    if options.lots:
        changes += [f"parking.lots={json.dumps(list(names_in(options.lots)))}", "curriculum=[]"]
    if minutes is not None:
        changes += ["steps=none", f"minutes={minutes}"]
    if steps is not None:
        changes += ["minutes=none", f"steps={steps}"]
    if options.simulator:
        from race_server.second.simulator import check_simulator

        check_simulator(options.simulator)
        changes += [f"simulator={options.simulator}"]
    if options.algorithm:
        changes += [f"algorithm.name={options.algorithm}"]
    for name in ("seed", "worlds", "threads"):
        if (value := getattr(options, name)) is not None:
            changes.append(f"{name}={value}")
    return changes + (options.changes or [])


@contextmanager
def _left_clean(place: Path) -> Iterator[None]:
    """Remove the folder of a run that could not begin."""
    from race_agents.training import folder

    try:
        yield
    finally:
        with suppress(OSError):
            folder.abandon(place)


@contextmanager
def _disk_named(place: Path) -> Iterator[None]:
    """Explain how a full or locked disk, or too little memory, ended a training."""
    try:
        yield
    except MemoryError as error:
        raise ScenarioError(
            f"{place}: not enough memory for this training; choose smaller worlds, "
            "evaluation.seeds, or algorithm.options.n_steps or buffer_size"
        ) from error
    except OSError as error:
        raise ScenarioError(
            f"{error.filename or place}: {error.strerror or error}; the training has stopped; if "
            "it left a latest.pt, --resume continues it"
        ) from error


@contextmanager
def _bar(settings: "Settings", console: Console) -> Iterator[Callable[["TrainingProgress"], None]]:
    """Show the progress and the latest figures of a training."""
    from rich.progress import BarColumn, Progress, TimeRemainingColumn
    from rich.table import Column

    # On a narrow terminal the last figures are cut, not the bar and the time.
    length = min(40, console.width // 5)
    words = Column(no_wrap=True, max_width=max(console.width - length - BESIDE_BAR, 12))
    columns = (
        TextColumn("{task.description}", table_column=words),
        BarColumn(length),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
    )
    hidden = not console.is_terminal
    with Progress(*columns, console=console, disable=hidden) as bar:
        task = bar.add_task(settings.title or "training", total=1.0)

        def tell(news: "TrainingProgress") -> None:
            bar.update(task, completed=news.share, description=_words_of(news))
            if news.marks is not None:
                console.print(
                    f"{100.0 * news.share:3.0f} %, {news.steps} decisions; {_words_of(news)}; "
                    f"validation: {news.marks}",
                    soft_wrap=True,
                )

            if news.ratings:
                console.print(f"ratings: {_ratings_in_words(news)}", soft_wrap=True)

        yield tell


def _words_of(news: "TrainingProgress") -> str:
    reward = "–" if news.reward is None else f"{news.reward:.1f}"
    figures = f"return {reward}, {news.figures}, {news.steps_per_s:.0f} steps/s"
    return ": ".join(word for word in (news.stage, news.method, figures) if word)


def _ratings_in_words(news: "TrainingProgress") -> str:
    return ", ".join(f"{one.driver} {one.mu:.0f} ± {one.high - one.mu:.0f}" for one in news.ratings)


def _show(
    outcomes: list["TrainingResult"], settings: "Settings", console: Console, *, as_json: bool
) -> None:
    if as_json:
        rows = [
            {
                "run": outcome.folder.name,
                "folder": str(outcome.folder),
                "stopped": outcome.stopped,
                **outcome.evaluation,
            }
            for outcome in outcomes
        ]
        print_document({"policies": rows} if settings.policies else rows[0])
        return
    for outcome in outcomes:
        _show_marks(outcome, settings, console)


def _show_marks(outcome: "TrainingResult", settings: "Settings", console: Console) -> None:
    from rich.table import Table

    from race_agents.training.folder import ways_to_drive

    known = ", ".join(outcome.evaluation["learned_on"])
    unseen = "under unseen seeds" if settings.parks else "on unseen courses"
    whose = f"the best {outcome.folder.name}" if settings.policies else "the best policy"
    title = f"{whose} {unseen}" + (f", but it learned on {known}" if known else "")
    of_all = outcome.marks[-1]
    table = Table(of_all.courses.removesuffix("s"), title=title, title_justify="left")
    for column in (*of_all.heads, "return"):
        table.add_column(column.replace(" [", ", ").removesuffix("]"), justify="right")
    for one in outcome.marks:
        table.add_row(one.course, *one.cells(), f"{one.reward:.1f}")
    Console().print_whole(table)
    console.print(f"drive it: {ways_to_drive(outcome.folder, settings)[0]}", soft_wrap=True)
