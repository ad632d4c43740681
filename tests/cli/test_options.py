"""Options of commands: they stand in dataclasses, which also give the words of a command line."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from typer.testing import CliRunner

from race_server.cli.option_fields import argv_of, expand_options
from race_server.cli.serve_options import RaceOptions, ServeOptions


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
