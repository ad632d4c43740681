"""The page as it was built into this package: read once, served from memory."""

import gzip
import mimetypes
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

FOLDER = Path(__file__).parent / "page"
INDEX, ASSETS = "index.html", "assets"
NOT_BUILT = "The page is not built: run `make page` (needs Node 20)"
# Smaller files [bytes] gain nothing from compression.
MIN_PACKED = 512
_TEXTS = ("text/", "application/javascript", "application/json", "image/svg+xml")


def is_built(folder: Path = FOLDER) -> bool:
    """Return whether the page is built."""
    return (folder / INDEX).is_file()


@dataclass(frozen=True)
class File:
    """One file of the page."""

    content: bytes
    kind: str  # its media type
    packed: bytes = b""  # by gzip; empty where that saves nothing


@dataclass(frozen=True)
class Page:
    """All files of the page, by their path in an address; no other file is ever opened."""

    files: Mapping[str, File] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path = FOLDER) -> "Page":
        """Return the page of a folder; where it is not built, a text that says so."""
        if not is_built(folder):
            return cls({"": File(f"{NOT_BUILT}\n".encode(), "text/plain; charset=utf-8")})
        files = {"": _read(folder / INDEX)}
        for path in sorted((folder / ASSETS).glob("*")):
            if path.is_file():
                files[f"{ASSETS}/{path.name}"] = _read(path)
        return cls(files)


def _read(path: Path) -> File:
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    content = path.read_bytes()
    is_text = kind.startswith(_TEXTS)
    packed = gzip.compress(content, 9, mtime=0) if is_text else b""
    charset = "; charset=utf-8" if kind.startswith("text/") else ""
    is_useful = len(content) >= MIN_PACKED and len(packed) < len(content)
    return File(content, kind + charset, packed if is_useful else b"")
