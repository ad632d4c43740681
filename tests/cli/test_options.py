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
from race_server.errors import DriverError, ScenarioError
from support.lots import ONE_BAY


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
        ("serve --format time-trial --attempts 101", "less than or equal to 100"),
        ("serve --format time-trial --attempts 70000", "less than or equal to 100"),
        ("serve --format time-trial --attempt-limit inf", "less than or equal to 86400"),
        ("start --format time-trial --attempt-limit 1e300", "less than or equal to 86400"),
        ("start --format time-trial --call-limit inf", "less than or equal to 86400"),
        ("start --format time-trial --cool-down nan", "less than or equal to 86400"),
        ("serve --once --review 1e300", "less than or equal to 86400"),
        ("serve --finish-limit inf", "less than or equal to 86400"),
        ("serve --finish-limit 1e300", "less than or equal to 86400"),
        ("start --lot gate --limit inf", "less than or equal to 86400"),
        ("start --mixed 1 --pedestrian inf", "less than or equal to 86400"),
        ("serve --wait-for -7", "greater than or equal to -1"),
        ("serve --wait-for 65", "less than or equal to 64"),
        (
            "start --races 2 --seed 9223372036854775807",
            "the last of 2 seeds is 9223372036854775808",
        ),
        ("drive idm --patience nan", "less than or equal to 86400"),
        ("drive idm --patience -1", "greater than or equal to 0"),
        ("drive idm --seat 99999", "less than or equal to 63"),
        ("drive idm --seat -2", "greater than or equal to -1"),
        ("watch --foxglove 99999", "less than or equal to 65535"),
        ("admin penalty 99999", "less than or equal to 63"),
        ("admin protest 0 --against 64 --why cut", "less than or equal to 63"),
        ("admin dismiss 65536", "less than or equal to 65535"),
        ("admin park 64", "less than or equal to 63"),
        ("relay --there x --bring 99999", "'99999' is no seat; write numbers from 0 to 63"),
        ("relay --there x --bring -3", "--bring '-3': '-3' is no seat; write numbers from 0"),
        ("relay --there x --send 0,\u0663", "is no seat; write numbers from 0 to 63"),
        ("relay --there x --bring 1,2,1", "--bring '1,2,1': seat 1 is there twice; name it once"),
        ("relay --there x --patience inf", "less than or equal to 86400"),
        ("keys new cup --days inf", "less than or equal to 36500"),
        ("keys new cup --days 1e9", "less than or equal to 36500"),
        ("exam parking --gap mass=1e300", "FACTOR=VALUE, at most 1000"),
        ("exam parking --gap mass=nan", "FACTOR=VALUE, at most 1000"),
    ],
)
def test_a_number_beyond_reason_is_refused_with_what_is_within(words: str, within: str) -> None:
    from race_server.cli.main import app

    told = CliRunner().invoke(app, words.split(), env={"COLUMNS": "200"})
    assert told.exit_code != 0
    assert within in f"{told.output} {told.exception}"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--laps 1001", "--laps 1001: an attempt has 1000 laps at most; choose fewer"),
        ("--attempt-limit 0.5", "--attempt-limit 0.5: give 1 second or more, or 0 for as many"),
        # Of two attempts the second one has the largest seed.
        (f"--attempts 2 --seed {MOST_SEED}", f"choose one from 0 to {MOST_SEED - 1}"),
    ],
)
def test_an_event_that_could_not_be_read_again_is_refused_before_anyone_waits(
    words: str, said: str, tmp_path: Path
) -> None:
    from race_server.cli.main import app

    given = ["serve", "--format", "time-trial", "--track", "oval", "--record", str(tmp_path)]
    told = CliRunner().invoke(app, [*given, *words.split()])
    assert isinstance(told.exception, ScenarioError)
    assert said in str(told.exception)


def test_an_event_at_the_limits_of_its_options_is_read_again(tmp_path: Path) -> None:
    from race_server.cli.serve_event import event_of
    from race_server.competition.race_day.formats.reader import format_of, words_of
    from race_server.core.bounds import MOST_S

    options = ServeOptions(
        track="oval",
        format="time-trial",
        laps=1000,
        attempts=100,
        attempt_limit=MOST_S,
        seed=MOST_SEED - 99,
        record=str(tmp_path),
    )
    form = event_of(options, needs_line=False)[0].format
    assert format_of(form.name, words_of(form), "there") == form


def test_races_of_one_driver_have_no_ratings_and_it_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from race_server.cli.main import app
    from race_server.competition import launch

    document = {"stopped": False, "karts": [{"driver": "idm", "rank": 1}]}
    monkeypatch.setattr(launch, "run_race", lambda *_: document)
    words = "start --track oval --drivers idm --races 2 --no-page --results none"
    told = CliRunner().invoke(app, words.split(), env={"COLUMNS": "200"})
    assert told.exit_code == 0
    assert told.stdout.splitlines() == [
        "ratings need two different drivers, and all seats have idm: name another one in "
        "--drivers, or give more seats with --karts",
        "race 1 of 2, seed 1: won by idm",
        "race 2 of 2, seed 2: won by idm",
    ]


def test_what_cannot_be_parked_is_refused_before_anyone_waits(tmp_path: Path) -> None:
    from race_server.cli.main import app

    lot = tmp_path / "parted.toml"
    # Starts on both sides of a wall without a gate; that of the seed 1 is on the far one.
    text = ONE_BAY.replace("[5, 10]", "[4, 20]").replace("[5, 15]", "[9, 11]")
    lot.write_text(f"walls = [[17, 0, 17, 20]]{text}")
    given = ["serve", "--lot", str(lot), "--karts", "1", "--seed", "1", "--record", "none"]
    told = CliRunner().invoke(app, given)
    assert isinstance(told.exception, ScenarioError)
    assert "no free way leads from" in str(told.exception)


def test_a_driver_that_does_not_park_is_refused_by_the_command_to_park() -> None:
    from race_server.cli.main import app

    told = CliRunner().invoke(app, ["park", "--driver", "valet,follow_gap"])
    assert isinstance(told.exception, DriverError)
    assert "'follow_gap' cannot park: it takes no order" in str(told.exception)
