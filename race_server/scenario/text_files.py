"""Text and TOML out of files that may come from anywhere, read within bounds."""

import re
import tomllib
from pathlib import Path
from typing import Any

from race_server.errors import RaceError

# Bytes of a file of settings, and words of one of its keys: a longer key takes `tomllib` a time
# that grows with the square of its length.
MOST_TOML, MOST_KEY_WORDS = 1 << 19, 16
_POINT_OF_A_NUMBER = re.compile(r"\d\.\d")


def read_text(path: Path, most_bytes: int, error: type[RaceError]) -> str:
    """Return the text of a file, without the mark that some programs put before UTF-8.

    Raises:
        RaceError: an `error`; it cannot be read, is no file, is larger, or not UTF-8.
    """
    try:
        if path.exists() and not path.is_file():
            raise error(f"{path}: cannot be read: it is no file")
        with path.open("rb") as file:
            data = file.read(most_bytes + 1)
        if len(data) > most_bytes:
            raise error(
                f"{path}: larger than {most_bytes} bytes; leave out what is not needed, such as "
                "every second point"
            )
        return data.decode("utf-8-sig")
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror}") from problem
    except UnicodeDecodeError as problem:
        raise error(f"{path}: cannot be read: it is not UTF-8; save it as that") from problem
    except ValueError as problem:  # of the name: a zero byte, half of a pair of surrogates
        raise error(f"{str(path)!r}: no file can have this name; give another one") from problem


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises:
        ValueError: it is no TOML, nested too deep, or too long.
    """
    if len(text) > MOST_TOML:
        raise ValueError(f"longer than {MOST_TOML} characters")
    for number, line in enumerate(text.splitlines(), start=1):
        *keys, last = line.split("=")
        if last.lstrip().startswith("["):
            keys.append(last)
        for key in keys:
            if _POINT_OF_A_NUMBER.sub("", key).count(".") >= MOST_KEY_WORDS:
                raise ValueError(f"a key in line {number} has more than {MOST_KEY_WORDS} words")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deep") from error
