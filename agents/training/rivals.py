"""Opponents of a learner: drivers that never change, and snapshots of the learner."""

from collections.abc import Sequence
from pathlib import Path
from random import Random

from race_agents.training.settings import LEARNER, SelfPlaySettings

POOL = "pool"  # in the seats
SNAPSHOTS = "snapshots"


class Rivals:
    """The pool of self-play, and its seats."""

    def __init__(self, settings: SelfPlaySettings, folder: Path) -> None:
        """Start with the anchors, and with earlier snapshots of the run."""
        self.settings = settings
        self.folder = folder / SNAPSHOTS
        # By their number: one of more digits is later, though text has it before.
        self.snapshots = sorted(
            self.folder.glob("*.onnx"), key=lambda path: (len(path.stem), path.stem)
        )

    def place_for(self, decisions: int) -> Path:
        """Return the file for a snapshot of a learner after `done` decisions."""
        self.folder.mkdir(exist_ok=True)
        return self.folder / f"learner-{decisions:09d}.onnx"

    def add(self, snapshot: Path) -> None:
        """Add a snapshot to the pool; once it is full, remove the oldest but the first.

        The first stays, so that a learner that forgets how to beat it is noticed.
        """
        # A run that was killed before its checkpoint reaches the same snapshot again.
        self.snapshots = [*(one for one in self.snapshots if one != snapshot), snapshot]
        if len(self.snapshots) > self.settings.snapshots:
            self.snapshots.pop(min(1, len(self.snapshots) - 2)).unlink(missing_ok=True)

    def seated(self, chance: Random) -> tuple[str, ...]:
        """Return a driver for each seat that is not the learner's."""
        return tuple(
            self._drawn(chance) if seat == POOL else seat
            for seat in self.settings.seats
            if seat != LEARNER
        )

    def _drawn(self, chance: Random) -> str:
        if self.snapshots and chance.random() < self.settings.share:
            return driver_of(chance.choice(self.snapshots))
        return chance.choice(self.settings.anchors)

    def against(self, snapshot: Path, seats: int, chance: Random) -> tuple[str, ...]:
        """Return opponents to rate a snapshot by: as many as there are seats, at random."""
        others = [driver_of(path) for path in self.snapshots if path != snapshot]
        return _in_turn([*self.settings.anchors, *others], seats, chance)


def _in_turn(names: Sequence[str], seats: int, chance: Random) -> tuple[str, ...]:
    drawn = chance.sample(names, len(names))
    return tuple(drawn[seat % len(drawn)] for seat in range(seats))


def driver_of(snapshot: Path) -> str:
    """Return the name under which a snapshot drives."""
    return f"learned:{snapshot}"


def short_name(driver: str) -> str:
    """Return the name of a driver in tables: of a snapshot only that of its file."""
    return Path(driver.partition(":")[2]).stem if driver.endswith(".onnx") else driver
