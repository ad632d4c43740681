"""The keys of those for whom the gateway speaks: the spectator, drivers, the steward."""

from dataclasses import dataclass
from pathlib import Path

from race_server.admission.access import SPECTATOR, STEWARD, seat_name
from race_server.admission.keys import ABOUT, ClientKeys, read_client_keys
from race_server.errors import KeysError


@dataclass(frozen=True)
class KeyRing:
    """A folder that somebody was handed, or one with several such folders; or none."""

    folder: Path | None = None
    session: str = ""

    def of(self, role: str) -> ClientKeys | None:
        """Return the keys of a role, None in a session without keys.

        Raises:
            KeysError: they are not in the folder, or of no use.
        """
        if self.folder is None:
            return None
        if not (self.folder / ABOUT).exists():
            return read_client_keys(self.folder / role, self.session)
        held = read_client_keys(self.folder, self.session)
        if held.role != role:
            raise KeysError(
                f"the keys in {self.folder} are those of {held.role}, not of {role}: give the "
                f"folder in which `{SPECTATOR}`, `{STEWARD}` and the seats' keys lie"
            )
        return held

    def of_watcher(self) -> ClientKeys | None:
        """Return keys that let one watch: everybody's in a folder of one role do."""
        if self.folder is not None and (self.folder / ABOUT).exists():
            return read_client_keys(self.folder, self.session)
        return self.of(SPECTATOR)

    def of_seat(self, seat: int) -> ClientKeys | None:
        """Return the keys of a seat's driver."""
        if self.folder is not None and seat < 0:
            raise KeysError("this session has keys for each seat: say which seat you want")
        return self.of(seat_name(seat))

    def of_steward(self) -> ClientKeys | None:
        """Return the steward's keys."""
        return self.of(STEWARD)
