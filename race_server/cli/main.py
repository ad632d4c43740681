"""`race`: the words a person types. Errors are one line on stderr and exit code 2."""

import sys
from importlib.metadata import entry_points

import typer

from race_server.cli import (
    admin,
    bench,
    day,
    drill,
    gateway,
    keys,
    limit,
    race,
    recording,
    relay,
    results,
    serve,
    track,
    trial,
)
from race_server.errors import RaceError

app = typer.Typer(
    name="race",
    help="A race and game server for karts.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(race.start)
app.command()(serve.serve)
app.command()(race.drive)
app.command()(race.watch)
app.command()(gateway.gateway)
app.command()(relay.relay)
app.command()(limit.limit)
app.command()(day.day)
app.command()(trial.trial)
app.command()(recording.replay)
app.add_typer(recording.app, name="recording")
app.add_typer(track.app, name="track")
app.add_typer(bench.app, name="bench")
app.add_typer(drill.app, name="drill")
app.add_typer(results.app, name="results")
app.add_typer(keys.app, name="keys")
app.add_typer(admin.app, name="admin")
# Other packages bring commands of their own, or groups of them.
for point in entry_points(group="race_server.commands"):
    brought = point.load()
    if isinstance(brought, typer.Typer):
        app.add_typer(brought, name=point.name)
    else:
        app.command(point.name)(brought)


def main() -> None:
    """Run the command line."""
    try:
        app()
    except RaceError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
