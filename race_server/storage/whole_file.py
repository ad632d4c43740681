"""Files that other programs read while they are written again."""

from pathlib import Path

from race_server.kept_file import write_file


def write_whole(path: Path, text: str) -> None:
    """Write a file so that its readers find all of the old text or all of the new.

    What cannot be replaced, such as a pipe, is written as it is.

    Raises:
        OSError: it cannot be written; the old file is left as it was.
    """
    write_file(path, lambda file: file.write(text.encode()))
