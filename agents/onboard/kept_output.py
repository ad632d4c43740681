"""A file that keeps what a disk would not take, and tries again."""

from io import FileIO
from pathlib import Path


class KeptOutput:
    """A stream to write to; `drain` hands over to the disk what was written."""

    def __init__(self, path: Path) -> None:
        """Begin the file.

        Raises:
            OSError: it cannot be written.
        """
        self._file = FileIO(path, "w")
        self._kept = bytearray()
        self._taken = 0  # bytes that the disk has

    def write(self, data: bytes) -> int:
        """Keep what is to be written."""
        self._kept += data
        return len(data)

    def tell(self) -> int:
        """Return how many bytes were written."""
        return self._taken + len(self._kept)

    def flush(self) -> None:
        """Do nothing: only `drain` writes."""

    def drain(self) -> None:
        """Write what is kept; what was written already is not written again.

        Raises:
            OSError: the disk takes no more now.
        """
        while self._kept:
            count = self._file.write(self._kept)
            del self._kept[:count]
            self._taken += count

    def close(self) -> None:
        """Close the file."""
        self._file.close()
