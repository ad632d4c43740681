"""What `--help` of each command prints."""

from collections.abc import Iterator
from typing import Any

import pytest
import typer

from race_server.cli.main import app, command_line


def commands(command: Any, words: tuple[str, ...] = ("race",)) -> Iterator[tuple[str, Any]]:
    """Yield a command or group and all in it, each with the words that call it."""
    yield " ".join(words), command
    for name, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, (*words, name))


WRITTEN = dict(commands(typer.main.get_command(app)))
SHOWN = dict(commands(command_line()))


def without_spaces(text: str) -> str:
    """Return a text in which line breaks make no difference."""
    return "".join(text.split())


@pytest.mark.parametrize("words", WRITTEN)
def test_help_is_printed_as_it_is_written_with_all_units_in_brackets(
    words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "500")
    command = SHOWN[words]
    command.get_help(command.make_context(words, [], resilient_parsing=True))
    shown = without_spaces(capsys.readouterr().out)
    for one in (WRITTEN[words], *WRITTEN[words].params):
        assert without_spaces(one.help or "") in shown
