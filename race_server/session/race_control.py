"""Race control: what stewards and the session itself do to a race from outside."""

from collections.abc import Callable

from race_server.core import codes
from race_server.core.messages import Event, Fault, Flag
from race_server.core.stages.standings import rank
from race_server.core.state import World
from race_server.errors import Reason, SeatError
from race_server.session.event_log import EventLog
from race_server.session.interventions import Intervention, InterventionKind, carry_out
from race_server.session.journal_entries import JournalEntries
from race_server.session.parking import TO_NONE, check_slot, goes_to_slot
from race_server.session.seats import Seats


class RaceControl:
    """Flags, penalties, closed seats and the clock of one session."""

    def __init__(
        self,
        world: World,
        seats: Seats,
        event_log: EventLog,
        journal: JournalEntries,
        leave: Callable[[int], None],
    ) -> None:
        """Act on a session; every intervention is put into its `journal`.

        leave: takes the driver of a seat out of the session.
        """
        self._world, self._seats = world, seats
        self._event_log, self._journal, self._leave = event_log, journal, leave
        self.is_paused = False  # the clock stands

    def show_flag(self, flag: Flag) -> None:
        """Show a flag to all karts."""
        self.intervene(InterventionKind.FLAG, value=float(flag))

    def penalise(self, number: int, seconds: float) -> None:
        """Add a penalty to the race time of a seat.

        Raises:
            SeatError: the seat is not taken.
        """
        self.intervene(InterventionKind.PENALTY, self._seats.taken_one(number).number, seconds)

    def penalise_late(self, number: int, seconds: float) -> list[Event]:
        """Add a penalty to a race that is over, rank its karts again, return what happened.

        The recording of the race is closed, so this intervention is in none.
        """
        act = Intervention(self._tick, InterventionKind.PENALTY, number, seconds)
        carry_out(self._world, act)
        rank(self._world, 0)
        return self._event_log.collect(self._world)

    def close_seat(self, number: int) -> None:
        """Close a seat to new drivers; a driver that has it keeps it."""
        self._seats.check(number)
        self.intervene(InterventionKind.CLOSE, number, 0.0)

    def open_seat(self, number: int) -> None:
        """Open a closed seat again."""
        self._seats.check(number)
        self.intervene(InterventionKind.OPEN, number)

    def exclude(self, number: int) -> None:
        """Take a seat from its driver, which may not come back."""
        self.intervene(InterventionKind.CLOSE, self._seats.taken_one(number).number, 1.0)
        self._leave(number)

    def remove(self, number: int, fault: Fault) -> None:
        """Take a kart out of the race; its driver keeps the seat.

        Raises:
            SeatError: the seat is not taken, or its kart does not race.
        """
        seat = self._seats.taken_one(number)
        if self._world.bodies["status"][0, number] != codes.RACING:
            raise SeatError(f"the kart of seat {number} is in no race", Reason.DECISION)
        self.intervene(InterventionKind.REMOVE, seat.number, float(fault))

    def pause(self, *, is_paused: bool = True) -> None:
        """Stop the clock of the race, or restart it; the server's loop applies this."""
        self.intervene(InterventionKind.CLOCK, value=float(is_paused))

    def park(self, number: int, slot: int = -1) -> None:
        """Tell the vehicle of a seat to park. slot: number of its slot, -1 for the one it has.

        Raises:
            SeatError: the seat is not taken, there is no car park, or the slot is not free.
        """
        check_slot(self._world, self._seats.taken_one(number).number, slot)
        self.intervene(InterventionKind.PARK, number, float(slot))

    def cancel_parking(self, number: int) -> None:
        """Let the vehicle of a seat go to no slot any more; do nothing where it goes to none."""
        if goes_to_slot(self._world, number):
            self.intervene(InterventionKind.PARK, number, float(TO_NONE))

    def use_item(self, number: int) -> None:
        """Press the item button of a kart for one tick, for a person beside its driver.

        Raises:
            SeatError: the seat is not taken, or its kart holds no item.
        """
        seat = self._seats.taken_one(number)
        if not self._world.players["held"][0, number]:
            raise SeatError(f"the kart of seat {number} holds no item", Reason.DECISION)
        seat.uses_item = True

    def hand_wheel(self, number: int, *, to_server: bool) -> None:
        """Let the parking driver of the server drive the kart of a seat, or its driver again."""
        self.intervene(InterventionKind.WHEEL, number, float(to_server))

    def intervene(self, kind: InterventionKind, kart: int = -1, value: float = 0.0) -> None:
        """Apply an intervention to the race, and add it to the journal."""
        act = Intervention(self._tick, kind, kart, value)
        self._journal.add(act)
        self.repeat(act)

    def repeat(self, act: Intervention) -> None:
        """Carry out an intervention that is in a journal already."""
        carry_out(self._world, act)
        if act.kind is InterventionKind.CLOSE:
            self._seats.close(act.kart, sent_away=bool(act.value))
        elif act.kind is InterventionKind.OPEN:
            self._seats.unclose(act.kart)
        elif act.kind is InterventionKind.CLOCK:
            self.is_paused = bool(act.value)
        elif act.kind is InterventionKind.PARK:
            self._seats[act.kart].orders += 1
            self._seats[act.kart].keeps_wheel = False
        elif act.kind is InterventionKind.WHEEL:
            self._seats[act.kart].is_led = bool(act.value)
            self._seats[act.kart].keeps_wheel = not act.value

    @property
    def _tick(self) -> int:
        return int(self._world.races[0].tick)
