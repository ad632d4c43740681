"""What a receiver tells of one moment, whatever the order of its messages."""

from dataclasses import dataclass, field
from typing import Any

# Moments that were left incomplete for longer than this [s] are too old to be told.
MOST_LATE_S = 0.5

Told = dict[str, Any]  # by the kind of message


@dataclass
class Epoch:
    """Gathers the messages of one moment.

    They are complete once all kinds have come that came of the two moments before. Where one is
    missing, what there is is given once the next moment begins.
    """

    period_s: float  # after which the receiver's time begins again
    _at_s: float = 0.0
    _told: Told = field(default_factory=dict)
    _is_given: bool = False
    _before: frozenset[str] = frozenset()  # kinds of the last moment
    _usual: frozenset[str] = frozenset()  # … and of the one before it

    def take(self, at_s: float, kind: str, value: Any) -> list[Told]:
        """Take a message of a moment [s]; return what is now told of moments, oldest first."""
        given = []
        if self._told and (at_s != self._at_s or kind in self._told):
            late_s = (at_s - self._at_s) % self.period_s
            ended = self.end()
            given += ended if late_s <= MOST_LATE_S else []
        self._at_s = at_s
        self._told[kind] = value
        if not self._is_given and self._usual and self._usual <= self._told.keys():
            self._is_given = True
            given.append(self._told)
        return given

    def end(self) -> list[Told]:
        """End the moment: nothing more comes of it. Return what was not given yet of it."""
        told, is_given = self._told, self._is_given
        if told:
            kinds = frozenset(told)
            self._usual, self._before = kinds | self._before, kinds
        self._told, self._is_given = {}, False
        return [told] if told and not is_given else []
