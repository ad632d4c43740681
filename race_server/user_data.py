"""Where the files of this user lie."""

import os
from pathlib import Path


def user_data(name: str) -> Path:
    """Return the path of a file or folder in $XDG_DATA_HOME, else in ~/.local/share.

    A path there that is not absolute counts as none: XDG Base Directory Specification 0.8.
    """
    data = Path(os.environ.get("XDG_DATA_HOME", ""))
    home = data if data.is_absolute() else Path.home() / ".local" / "share"
    return home / "race-server" / name
