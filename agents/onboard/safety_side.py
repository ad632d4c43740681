"""The side of a kart that keeps it safe: sensors, reflex, actuators, and no network.

It turns by itself. What the server wants and the driver does comes in a mailbox, and what the kart
knows goes out in another: the game's side may stall, fail or be killed, and the kart brakes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from race_agents.onboard.black_box import BlackBox
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.mailbox import Freshness, Mailbox, Memory, size_of
from race_agents.unit.readings import Readings
from race_agents.unit.records import MOST_REPORT, MOST_WORD, Report, Word
from race_agents.unit.safety import Command
from race_server.core.messages import Control

# The safety side turns this often [s].
PERIOD_S = 0.01
# Without the game's side for this long [s] it ends, its brakes on.
ALONE_S = 10.0
# … where that never spoke, after this time: it asks the server and gets its driver ready first.
START_S = 60.0
# … and once the kart has nothing more to do, this long.
PATIENCE_S = 1.0


class Hardware(Protocol):
    """A kart's body: sensors, actuators, and who holds the wheel."""

    def read(self, now_s: float) -> Readings:
        """Return what the sensors give now."""

    def act(self, command: Command) -> None:
        """Move the actuators."""

    def hands(self, control: Control | None, now_s: float) -> Control | None:
        """Return what comes from wheel and pedals now, if anything new does.

        control: what the driver decided on, None if it has seen nothing new.
        """


@dataclass
class Mailboxes:
    """The two mailboxes between the sides of a kart."""

    words: Mailbox  # from the game's side
    reports: Mailbox  # from the safety side

    @staticmethod
    def size() -> int:
        """Return how many bytes of memory they need."""
        return size_of(MOST_WORD) + size_of(MOST_REPORT)

    @classmethod
    def over(cls, memory: Memory) -> "Mailboxes":
        """Return them in some memory that is all zeros at first."""
        return cls(
            Mailbox(memory, MOST_WORD), Mailbox(memory, MOST_REPORT, offset=size_of(MOST_WORD))
        )

    def report(self) -> Report | None:
        """Return the newest report, None before the first one."""
        mail = self.reports.read()
        return None if mail is None else Report.unpack(mail.data)


@dataclass
class SafetySide:
    """Turns sensors, words and reflex into commands and reports."""

    unit: ControlUnit
    hardware: Hardware
    boxes: Mailboxes
    each_turn: Callable[["SafetySide", float], bool] = lambda _side, _now_s: True
    box: BlackBox | None = None  # keeps each turn
    is_cut: bool = False  # a drill switches the radio off
    is_through: bool = False
    _heard: Freshness = field(default_factory=Freshness)
    _word: Word = field(default_factory=Word)
    _began_s: float | None = None  # when it turned first

    def turn(self, now_s: float) -> None:
        """Sense, hear, decide, act, and tell."""
        self._began_s = now_s if self._began_s is None else min(self._began_s, now_s)
        readings = self.hardware.read(now_s)
        self.unit.sense(readings)
        self._hear(now_s)
        self.hardware.act(self.unit.decide(now_s))
        if self.box is not None:
            self.box.note(readings, self.unit)
        self.is_through |= not self.each_turn(self, now_s)
        unit = self.unit
        report = Report(
            *(unit.pose(), unit.alert(), unit.buttons, unit.ranges, unit.health()),
            *(self.is_through, self.is_cut, unit.braking),
        )
        self.boxes.reports.write(report.pack(), now_s)

    def _hear(self, now_s: float) -> None:
        """Take the newest word of the game's side."""
        mail, decided = self.boxes.words.read(), None
        if self._heard.note(mail, now_s):
            assert mail is not None
            before, self._word = self._word, Word.unpack(mail.data)
            self.unit.hear_game(now_s)
            word = self._word
            self.unit.hear_peers(word.peers)
            if word.orders is not None and (word.heard_s, word.orders) != (
                before.heard_s,
                before.orders,
            ):
                self.unit.hear(word.orders, word.heard_s)
            if word.decisions != before.decisions:
                decided = word.control
        control = self.hardware.hands(decided, now_s)
        if control is not None:
            self.unit.drive(control, now_s)

    def is_alone(self, now_s: float) -> bool:
        """Return whether the game's side has been silent for long, or has nothing more to say."""
        if self._heard.counter == 0:
            return self._began_s is not None and now_s - self._began_s > START_S
        most_s = PATIENCE_S if self.is_through else ALONE_S
        return now_s - self._heard.since_s > most_s

    def stop(self) -> None:
        """Leave the kart with its brakes on."""
        self.hardware.act(Command())
        if self.box is not None:
            self.box.close()
