"""Files that other programs read while they are written again."""

from pathlib import Path

from race_server.kept_file import write_together


def write_whole(path: Path, text: str) -> None:
    """Write a file so that its readers find all of the old text or all of the new.

    What is no plain file, such as a pipe, is written as it is.

    Raises:
        OSError: it cannot be written; the old file is left as it was.
    """
    path = path.resolve()
    if path.exists() and not path.is_file():
        path.write_text(text, encoding="utf-8")
    else:
        write_together({path: text.encode()})
