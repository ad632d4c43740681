"""Which connection owns each seat: the one whose badge matches the key of the driver that joined.

Used from several threads: network threads record links and check badges, the server's loop admits.
"""

from collections import deque

from race_server.credentials import key_of_badge

# Older changes of links are dropped beyond this.
MOST_NEWS = 256
# Limit of links of one seat that are distinguished.
MOST_BADGES = 8


class SeatOwners:
    """The owners of a session's seats."""

    def __init__(self, seats: int) -> None:
        """Create without owners."""
        self._keys: list[bytes] = [b""] * seats  # of the driver that joined
        self._badges: list[bytes] = [b""] * seats  # that match them, once known
        self._seen: list[dict[bytes, None]] = [{} for _ in range(seats)]  # badges of open links
        self.news: deque[tuple[int, bool]] = deque(
            maxlen=MOST_NEWS
        )  # links of owners that came or went

    def admit(self, seat: int, key: bytes) -> None:
        """Make the connection whose badge matches the key the only owner of a seat."""
        if key == self._keys[seat]:
            return
        self._keys[seat], self._badges[seat] = key, b""
        for badge in list(self._seen[seat]):
            if self.is_holder(seat, badge):
                self.news.append((seat, True))

    def is_holder(self, seat: int, badge: bytes) -> bool:
        """Return whether a badge is that of the seat's owner."""
        known = self._badges[seat]
        if not known and key_of_badge(badge) == self._keys[seat]:
            known = self._badges[seat] = badge
        return bool(known) and badge == known

    def note_link(self, seat: int, badge: bytes, *, is_there: bool) -> bool:
        """Record a link; return False for a second one while the owner's is open."""
        seen, is_holder = self._seen[seat], self.is_holder(seat, badge)
        if not is_there:
            seen.pop(badge, None)
        elif is_holder or len(seen) < MOST_BADGES:
            seen[badge] = None
        if is_holder:
            self.news.append((seat, is_there))
        return is_holder or not is_there or self._badges[seat] not in seen

    def is_doubled(self, seat: int) -> bool:
        """Return whether a seat has two links at once."""
        return len(self._seen[seat]) > 1
