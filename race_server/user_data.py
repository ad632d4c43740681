"""Where the files of this user lie."""

import os
from pathlib import Path

from race_server.errors import ScenarioError


def user_data(name: str) -> Path:
    """Return the path of a file or folder in $XDG_DATA_HOME, else in ~/.local/share.

    A path there that is not absolute counts as none: XDG Base Directory Specification 0.8.

    Raises:
        ScenarioError: this user has no home.
    """
    data = Path(os.environ.get("XDG_DATA_HOME", ""))
    home = data if data.is_absolute() else path_named("~/.local/share")
    return home / "race-server" / name


def path_named(words: str) -> Path:
    """Return the path that an option or a variable names, where ~ is a home.

    Raises:
        ScenarioError: there is no such user, or this one has no home.
    """
    try:
        return Path(words).expanduser()
    except RuntimeError as error:
        raise ScenarioError(
            f"{words}: {Path(words).parts[0]} is the home of no user here; name a path without ~, "
            "and let $XDG_DATA_HOME or $HOME name a folder"
        ) from error
