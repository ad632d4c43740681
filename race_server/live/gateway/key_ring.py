"""The keys that a gateway uses for its browsers: a spectator's, drivers' and a steward's."""

from dataclasses import dataclass
from pathlib import Path

from race_server.errors import KeysError
from race_server.net.auth.access import SPECTATOR, STEWARD, seat_name
from race_server.net.auth.keys import ABOUT, ClientKeys, read_client_keys

MAX_KARTS = 64


@dataclass(frozen=True)
class KeyRing:
    """A folder with the keys of one role, or one with several such folders; or none."""

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

    def of_spectator(self) -> ClientKeys | None:
        """Return keys with which to watch: those of any role do."""
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
        held = [number for number in range(MAX_KARTS) if (self.folder / seat_name(number)).is_dir()]
        if not held:
            raise KeysError(f"{self.folder} holds keys of no seat: no browser can drive with them")
        return tuple(held)

    def of_steward(self) -> ClientKeys | None:
        """Return the steward's keys."""
        return self.of(STEWARD)
