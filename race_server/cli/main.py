"""`race`: the command line. An error is one line on stderr and exit code 2."""

import errno
import os
import shutil
import sys
import traceback
import warnings
from importlib.metadata import entry_points
from typing import Annotated, Any, TextIO

import typer
from rich.markup import escape  # noqa: TID251  # what typer shows is markup

from race_server.cli import (
    admin,
    bench,
    coach,
    day,
    drill,
    drill_evening,
    drive,
    drivers,
    entrants,
    event,
    gateway,
    keys,
    limit,
    lot,
    park,
    recording,
    relay,
    results,
    serve,
    start,
    track,
    trial,
)
from race_server.errors import RaceError
from race_server.terminal import say, take_any_letter
from race_server.version import __version__

# Columns of a terminal from which the help's five columns hold the longest words.
WIDE = 120
# What a system says of a disk that takes no more, and of a name at which it opens nothing.
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
REFUSED = {errno.ENAMETOOLONG, errno.EACCES, errno.EPERM, errno.EROFS, errno.ELOOP, errno.ENOTDIR}

app = typer.Typer(
    name="race",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def print_version(wanted: bool) -> None:
    """Print the version and end, if that is wanted."""
    if wanted:
        say(f"race-server {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=print_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Serve, drive, watch and train kart races."""


app.command()(start.start)
app.command()(park.park)
app.command()(serve.serve)
app.command()(drive.drive)
app.command()(drive.watch)
app.command()(drivers.drivers)
app.command()(gateway.gateway)
app.command()(relay.relay)
app.command()(limit.limit)
app.command()(day.day)
app.command()(trial.trial)
app.command()(coach.coach)
app.command()(recording.replay)
app.add_typer(recording.app, name="recording")
app.add_typer(track.app, name="track")
app.add_typer(lot.app, name="lot")
app.add_typer(bench.app, name="bench")
app.add_typer(drill.app, name="drill")
drill.app.command()(drill_evening.evening)
app.add_typer(results.app, name="results")
app.add_typer(event.app, name="event")
app.add_typer(entrants.app, name="entrants")
app.add_typer(keys.app, name="keys")
app.add_typer(admin.app, name="admin")
# Other packages add commands, or groups of commands; `bench.plan` is one in the group `bench`.
groups = {"": app, "bench": bench.app, "drill": drill.app, "track": track.app}
for point in entry_points(group="race_server.commands"):
    command = point.load()
    place, _, name = point.name.rpartition(".")
    parent = groups[place]
    if isinstance(command, typer.Typer):
        parent.add_typer(command, name=name)
    else:
        parent.command(name)(command)


def command_line() -> Any:
    """Return the command `race`, whose help is shown as it is written.

    Typer takes help texts for markup of rich, which drops a unit such as [m]. In a narrow terminal
    its columns cut off what does not fit, such as a path, so there help has two columns, and none.
    """
    is_narrow = shutil.get_terminal_size().columns < WIDE

    def show_as_written(command: Any) -> None:
        if is_narrow:
            command.rich_markup_mode = None
            command.short_help = (command.help or "").partition("\n\n")[0]
        else:
            for one in (command, *command.params):
                one.help = escape(one.help or "")
        for inner in getattr(command, "commands", {}).values():
            show_as_written(inner)

    command = typer.main.get_command(app)
    show_as_written(command)
    return command


def main() -> None:
    """Run the command line."""
    take_any_letter()
    warnings.showwarning = _warn
    try:
        command_line()()
    except RaceError as error:
        say(f"error: {error}", error=True)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        if refusal := _refusal(error):
            say(f"error: {refusal}", error=True)
            _drop_output()
            sys.exit(2)
        # A fault of ours; what it tells may quote text from outside.
        say(traceback.format_exc(), error=True)
        sys.exit(1)


def _drop_output() -> None:
    """Drop what stdout cannot take: the interpreter would try once more as it ends, and fail."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _warn(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Tell a warning of ours in one line; others with the place that they come from."""
    del file
    if category is UserWarning:
        say(f"warning: {message}", error=True)
    else:
        say(warnings.formatwarning(message, category, filename, lineno, line), error=True)


def _refusal(error: Exception) -> str:
    """Return what to tell of a disk that is full or a name that is refused, "" of all else."""
    if not isinstance(error, OSError):
        return ""
    if error.errno in FULL:
        return f"the output cannot be written ({error.strerror}); make room, or choose another disk"
    if error.errno in REFUSED and error.filename is not None:
        return f"{error.filename}: {error.strerror}; name another file or folder"
    return ""
