"""What `--help` of each command prints."""

import os
from collections.abc import Iterator
from functools import cache
from typing import Any
from unittest.mock import patch

import pytest
import typer

from race_server.cli.main import app, command_line


def commands(command: Any, words: tuple[str, ...] = ("race",)) -> Iterator[tuple[str, Any]]:
    """Yield a command or group and all in it, each with the words that call it."""
    yield " ".join(words), command
    for name, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, (*words, name))


WRITTEN = dict(commands(typer.main.get_command(app)))


@cache
def shown_at(columns: str) -> dict[str, Any]:
    """Return the commands as a terminal of this width shows them."""
    with patch.dict(os.environ, COLUMNS=columns):
        return dict(commands(command_line()))


def without_spaces(text: str) -> str:
    """Return a text in which line breaks make no difference."""
    return "".join(text.split())


@pytest.mark.parametrize("columns", ["40", "80", "500"])
@pytest.mark.parametrize("words", WRITTEN)
def test_help_is_printed_as_it_is_written_with_all_units_in_brackets_however_wide(
    words: str, columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    command = shown_at(columns)[words]
    text = command.get_help(command.make_context(words, [], resilient_parsing=True))
    shown = without_spaces(text + capsys.readouterr().out)
    for one in (WRITTEN[words], *WRITTEN[words].params):
        assert without_spaces(one.help or "") in shown
