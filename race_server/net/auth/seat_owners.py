"""Which connection holds each seat: the one whose badge fits the key of who joined.

Several threads come here: those of the network note links and ask, the server's loop admits.
"""

from collections import deque

from race_server.credentials import key_of_badge

# More news of links than this is old news.
MOST_NEWS = 256
# So many links of one seat are told apart.
MOST_BADGES = 8


class SeatOwners:
    """The holders of a session's seats."""

    def __init__(self, seats: int) -> None:
        """Begin with nobody."""
        self._keys: list[bytes] = [b""] * seats  # of who joined
        self._badges: list[bytes] = [b""] * seats  # that fit them, once they were shown
        self._seen: list[dict[bytes, None]] = [{} for _ in range(seats)]  # badges of links there
        self.news: deque[tuple[int, bool]] = deque(maxlen=MOST_NEWS)  # holders that came or went

    def admit(self, seat: int, key: bytes) -> None:
        """Let a seat be held by whoever's badge fits the key, and by nobody else."""
        if key == self._keys[seat]:
            return
        self._keys[seat], self._badges[seat] = key, b""
        for badge in list(self._seen[seat]):
            if self.is_holder(seat, badge):
                self.news.append((seat, True))

    def is_holder(self, seat: int, badge: bytes) -> bool:
        """Return whether a badge is that of the connection which holds the seat."""
        known = self._badges[seat]
        if not known and key_of_badge(badge) == self._keys[seat]:
            known = self._badges[seat] = badge
        return bool(known) and badge == known

    def note_link(self, seat: int, badge: bytes, *, is_there: bool) -> bool:
        """Take note of a link; return False for one more than the holder's own, who is there."""
        seen, is_holder = self._seen[seat], self.is_holder(seat, badge)
        if not is_there:
            seen.pop(badge, None)
        elif is_holder or len(seen) < MOST_BADGES:
            seen[badge] = None
        if is_holder:
            self.news.append((seat, is_there))
        return is_holder or not is_there or self._badges[seat] not in seen

    def is_doubled(self, seat: int) -> bool:
        """Return whether two links at once show that they are a seat's."""
        return len(self._seen[seat]) > 1
