"""What acts on a race, as a recording holds it."""

from dataclasses import dataclass, field

from race_server.core.state import Float32s, Ints
from race_server.session.interventions import Intervention
from race_server.session.replay_guard import Granted
from race_server.session.tracked.karts import Placements


@dataclass(frozen=True, eq=False)
class Inputs:
    """The controls that act from a tick on, of those seats whose control changed."""

    tick: int
    seats: Ints  # (n,)
    controls: Float32s  # (n, 4) steering, throttle, brake, buttons
    sequences: Ints  # (n,) of the drivers' messages


# What acts on a race, in the order in which it does.
Entry = Inputs | Placements | Intervention | Granted


@dataclass
class JournalEntries:
    """Inputs of a race that are not yet written; the recorder empties it."""

    is_recorded: bool = False
    entries: list[Entry] = field(default_factory=list)

    def add(self, entry: Entry) -> None:
        """Put an entry into the journal, if the race is recorded."""
        if self.is_recorded:
            self.entries.append(entry)

    def drain(self) -> list[Entry]:
        """Return all entries since the last call."""
        entries, self.entries = self.entries, []
        return entries
