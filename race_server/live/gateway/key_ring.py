"""The keys of those for whom the gateway speaks: the spectator, drivers, the steward."""

from dataclasses import dataclass
from pathlib import Path

from race_server.errors import KeysError
from race_server.net.auth.access import SPECTATOR, STEWARD, seat_name
from race_server.net.auth.keys import ABOUT, ClientKeys, read_client_keys

MOST_KARTS = 64


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
        return self.of(seat_name(seat))

    def seats(self, wanted: int) -> tuple[int, ...]:
        """Return the seats to ask for: the wanted one, or for -1 each that there are keys for.

        Without keys -1 may itself be asked for.

        Raises:
            KeysError: there are keys, but for no seat.
        """
        if wanted >= 0 or self.folder is None:
            return (wanted,)
        held = [
            number for number in range(MOST_KARTS) if (self.folder / seat_name(number)).is_dir()
        ]
        if not held:
            raise KeysError(f"{self.folder} holds keys of no seat: nobody can drive with them")
        return tuple(held)

    def of_steward(self) -> ClientKeys | None:
        """Return the steward's keys."""
        return self.of(STEWARD)
