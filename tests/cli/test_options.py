"""Options of commands: they stand in dataclasses, which also give the words of a command line."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from typer.testing import CliRunner

from race_server.cli.option_fields import argv_of, expand_options
from race_server.cli.options import seeds_from
from race_server.cli.serve_options import RaceOptions, ServeOptions
from race_server.core.seeds import MOST_SEED
from race_server.errors import ScenarioError


@dataclass(frozen=True)
class Options:
    """Some options of each kind."""

    name: Annotated[str, typer.Option(help="Its name.")] = "one"
    most: Annotated[int, typer.Option("--at-most", min=1)] = 3
    folder: Annotated[Path | None, typer.Option()] = None
    is_fast: Annotated[bool, typer.Option("--fast")] = False
    guard: Annotated[bool, typer.Option("--guard/--no-guard")] = True
    others: Annotated[list[str] | None, typer.Option("--other")] = None


def parsed(*words: str) -> tuple[Options, int]:
    """Return what a command is given that has one option beside those of the class."""
    given: list[tuple[Options, int]] = []
    app = typer.Typer()

    @app.command()
    @expand_options
    def command(options: Options, times: Annotated[int, typer.Option()] = 1) -> None:
        given.append((options, times))

    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == 0, result.output
    return given[0]


def test_each_field_is_an_option_beside_those_of_the_command() -> None:
    assert parsed() == (Options(), 1)
    words = ["--name", "two", "--at-most", "5", "--fast", "--no-guard", "--times", "4"]
    assert parsed(*words) == (Options("two", 5, is_fast=True, guard=False), 4)


def test_bounds_of_a_field_are_bounds_of_its_option() -> None:
    app = typer.Typer()

    @app.command()
    @expand_options
    def command(options: Options) -> None:
        """Take options."""

    codes = [CliRunner().invoke(app, ["--at-most", most]).exit_code for most in ("0", "1")]
    assert codes == [2, 0]


@pytest.mark.parametrize(
    "options",
    [
        Options(),
        Options("two words", 7, Path("a/b"), is_fast=True, guard=False, others=["x", "y z"]),
        Options(others=["--strange"]),
    ],
)
def test_the_words_of_options_are_read_as_the_same_options(options: Options) -> None:
    assert parsed(*argv_of(options)) == (options, 1)


def test_options_at_their_defaults_need_no_words() -> None:
    assert argv_of(Options()) == []
    assert argv_of(Options(name="two", guard=False)) == ["--name", "two", "--no-guard"]


def test_start_takes_every_option_of_a_race_that_serve_takes() -> None:
    from race_server.cli.main import app

    commands: Any = typer.main.get_command(app)
    start, serve = (
        {one.name: one for one in commands.commands[name].params} for name in ("start", "serve")
    )
    assert {field.name for field in fields(ServeOptions)} == set(serve)
    for field in fields(RaceOptions):
        ours, theirs = start[field.name], serve[field.name]
        assert (ours.opts, ours.default, ours.help) == (theirs.opts, theirs.default, theirs.help)


def test_the_server_of_a_started_race_is_given_what_the_race_was_given() -> None:
    from race_server.cli.main import app

    given = ServeOptions(
        track="oval", karts=3, laps=2, seed=9, pace="lockstep", items="off", record="x", fresh=True
    )
    commands: Any = typer.main.get_command(app)
    context = commands.commands["serve"].make_context("serve", argv_of(given))
    assert ServeOptions(**context.params) == given


def test_seeds_count_up_to_the_largest_and_not_beyond() -> None:
    assert seeds_from(MOST_SEED - 1, 2)[-1] == 2**63 - 1
    with pytest.raises(ScenarioError) as told:
        seeds_from(MOST_SEED, 2)
    assert str(told.value) == (
        "--first-seed 9223372036854775807: the last of 2 seeds is 9223372036854775808, and a seed "
        "may be 9223372036854775807; choose a smaller one"
    )


@pytest.mark.parametrize(
    "words",
    [
        "lot show gate --seed",
        "park --seed",
        "start --seed",
        "serve --seed",
        "coach raceline --seed",
        "day --seed",
        "plant --seed",
        "demonstrate raceline --seed",
        "bench plan --seed",
        "bench onboard --seed",
        "drill faults --seed",
        "trial --first-seed",
        "exam parking --first-seed",
        "exam coaching --first-seed",
        "exam retention --first-seed",
    ],
)
def test_a_seed_of_2_to_the_63_is_refused_where_options_are_read(words: str) -> None:
    from race_server.cli.main import app

    told = CliRunner().invoke(app, [*words.split(), str(2**63)])
    assert told.exit_code != 0
    if isinstance(told.exception, SystemExit):
        assert "9223372036854775807" in told.output
    else:
        assert isinstance(told.exception, ScenarioError)
        assert "--first-seed 9223372036854775808: the last of" in str(told.exception)


@pytest.mark.parametrize("command", ["start", "serve"])
def test_a_race_is_on_a_course_or_in_a_car_park(command: str) -> None:
    from race_server.cli.main import app

    told = CliRunner().invoke(app, [command, "--lot", "gate", "--track", "oval"])
    assert str(told.exception) == "--lot gate and --track oval: leave one out"


@pytest.mark.parametrize(
    ("words", "within"),
    [
        ("day --seed -1", "greater than or equal to 0"),
        ("trial --decision-limit inf", "less than or equal to 3600"),
        ("trial --decision-limit 1e300", "less than or equal to 3600"),
        ("trial --decision-limit nan", "less than or equal to 3600"),
        ("trial --laps 99999999999999999999", "less than or equal to 100000"),
        ("start --laps 99999999999999999999", "less than or equal to 100000"),
        ("exam laps --warm-up 99999999999999999999", "less than or equal to 100000"),
        ("results list --limit 99999999999999999999", "less than or equal to 1000000"),
        ("replay race.mcap --play --speed inf", "less than or equal to 10000"),
        ("replay race.mcap --play --speed nan", "less than or equal to 10000"),
        ("replay race.mcap --play --speed 1e-320", "greater than or equal to 0.001"),
        ("exam parking --gap mass=1e300", "FACTOR=VALUE, at most 1000"),
        ("exam parking --gap mass=nan", "FACTOR=VALUE, at most 1000"),
    ],
)
def test_a_number_beyond_reason_is_refused_with_what_is_within(words: str, within: str) -> None:
    from race_server.cli.main import app

    told = CliRunner().invoke(app, words.split(), env={"COLUMNS": "200"})
    assert told.exit_code != 0
    assert within in f"{told.output} {told.exception}"
