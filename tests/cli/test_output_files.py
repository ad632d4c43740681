"""Files that commands write: a place where none can be is refused before anything is driven."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from race_server.cli.main import app

PICTURES = (
    "coach raceline --picture",
    "limit oval --plot",
    "lot show yard-70 --to",
    "track show oval --to",
    "trial --plot",
    "exam parking --plot",
    "exam laps --plot",
    "exam races --plot",
    "exam sweep --plot",
    "day --sheet",
)
OTHERS = (
    "trial --csv",
    "trial --laps-csv",
    "trial --save-lap",
    "demonstrate raceline --out",
    "bench plan --plot",
    "bench env --plot",
)


def refused(words: str, path: Path) -> str:
    """Return why a command does not begin that is to write this file."""
    return str(CliRunner().invoke(app, [*words.split(), str(path)]).exception)


@pytest.mark.parametrize("words", [*PICTURES, *OTHERS])
def test_a_file_in_a_folder_that_does_not_exist_is_refused(words: str, tmp_path: Path) -> None:
    path = tmp_path / "none" / "file.png"
    assert refused(words, path) == f"{path}: its folder does not exist; make it first"


@pytest.mark.parametrize("words", [*PICTURES, *OTHERS])
def test_a_folder_is_no_file_to_write(words: str, tmp_path: Path) -> None:
    path = tmp_path / "folder.png"
    path.mkdir()
    assert refused(words, path) == f"{path}: is a folder; name a file"


@pytest.mark.parametrize("words", [*PICTURES, *OTHERS])
def test_a_folder_that_takes_no_file_is_refused(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("race_server.kept_file.os.access", lambda *_: False)
    path = tmp_path / "file.png"
    assert refused(words, path) == f"{path}: cannot be written here; name another folder"


@pytest.mark.parametrize("words", PICTURES)
def test_an_ending_of_no_picture_is_refused(words: str) -> None:
    assert "file.txt: write the picture as .png or .svg" in refused(words, Path("file.txt"))


def test_two_tables_do_not_go_into_one_file(tmp_path: Path) -> None:
    path = tmp_path / "laps.csv"
    again = tmp_path / "below" / ".." / "laps.csv"
    (tmp_path / "below").mkdir()
    for words in (f"trial --csv {again} --laps-csv", f"trial --save-lap {again} --csv"):
        told = refused(words, path)
        assert told == f"{path}: two options write this file; name another for one"
