"""How the program begins."""

import signal
import subprocess
import sys
import warnings

import pytest

from race_server.cli import entry, main

INTERRUPTED = """
import os, runpy, signal, sys

class Finder:
    def find_spec(self, name, *_):
        if name == "race_server.cli.main":
            os.kill(os.getpid(), signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Finder())
runpy.run_module("race_server", run_name="__main__")
"""


def test_a_program_that_is_interrupted_while_it_is_imported_says_nothing() -> None:
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, b"", b"")


@pytest.mark.parametrize("held", [signal.default_int_handler, signal.SIG_IGN])
def test_a_program_that_is_imported_takes_ctrl_c_as_before(
    held: signal.Handlers, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[object] = []
    monkeypatch.setattr(main, "main", lambda: found.append(signal.getsignal(signal.SIGINT)))
    before = signal.signal(signal.SIGINT, held)
    try:
        entry.main()
    finally:
        signal.signal(signal.SIGINT, before)
    assert found == [held]


def test_a_warning_is_one_line_without_a_place_in_the_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def command() -> None:
        warnings.warn("no line fits on 'lane'", stacklevel=1)

    monkeypatch.setattr(main, "command_line", lambda: command)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        main.main()
    assert capsys.readouterr().err == "warning: no line fits on 'lane'\n"
