"""Files that commands write: a place where none can be is refused before anything is driven."""

import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO

import pytest
from typer.testing import CliRunner

from race_server.cli.main import app, main
from race_server.kept_file import keep, write_together

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
    "bench plan --plot",
    "bench env --plot",
)
OTHERS = (
    "trial --csv",
    "trial --laps-csv",
    "trial --save-lap",
    "demonstrate raceline --out",
    "policy check parking-1 --example",
    "bench onboard --golden",
    "plant --report",
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


def test_plans_that_are_driven_have_no_picture(tmp_path: Path) -> None:
    told = refused("bench plan --vehicle lorry-16m5 --drive --plot", tmp_path / "p.png")
    assert told.endswith("leave --plot out")


@pytest.mark.parametrize("words", ["trial --csv", "coach", "limit oval --plot"])
def test_a_name_that_is_too_long_is_refused_in_one_line(
    words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["race", *words.split(), f"{'x' * 300}.png"])
    with pytest.raises(SystemExit, match="2"):
        main()
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.endswith(": File name too long; name another file or folder\n")
    assert told.err.count("\n") == 1


@pytest.mark.parametrize("kind", ["lot", "track"])
def test_a_lot_or_track_of_a_name_that_is_too_long_for_a_file_is_unknown(
    kind: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["race", kind, "check", "x" * 300])
    with pytest.raises(SystemExit, match="2"):
        main()
    told = capsys.readouterr().err
    assert f"'{'x' * 300}' is unknown; choose one of" in told
    assert told.count("\n") == 1


def test_a_disk_that_is_full_is_told_in_one_line() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "race_server", "drivers", "--json"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr == (
        "error: the output cannot be written (No space left on device); make room, or choose "
        "another disk\n"
    )


def test_a_recording_is_not_written_over_by_what_is_made_of_it(tmp_path: Path) -> None:
    path = tmp_path / "race.mcap"
    path.write_bytes(b"a race")
    told = refused(f"demonstrate --recording {path} --out", path)
    assert told == f"--out {path}: is the recording, which would be lost; name another file"
    assert path.read_bytes() == b"a race"


def test_files_that_another_process_writes_aside_are_left_to_it(tmp_path: Path) -> None:
    others = tmp_path / "course.toml.part"
    others.write_bytes(b"half of a")
    write_together({tmp_path / "course.toml": b"whole"})
    assert others.read_bytes() == b"half of a"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["course.toml", "course.toml.part"]


@pytest.mark.parametrize("end", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_half_a_file_stays_nowhere_in_the_cache(end: BaseException, tmp_path: Path) -> None:
    def write(file: IO[bytes]) -> None:
        file.write(b"half")
        raise end

    with suppress(KeyboardInterrupt):
        keep(tmp_path / "kept", write)
    assert list(tmp_path.iterdir()) == []
    keep(tmp_path / "kept", lambda file: file.write(b"whole"))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"whole"]
