"""The life of a race session: lobby, countdown, race, finish. No network, no clock, no files.

Who drives what is decided here; what happens on the track is decided by the world. The server
feeds joins, controls and ticks in, and takes events, observations and standings out.
"""

import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from race_server import codes
from race_server.acts import Act, ActKind, carry_out
from race_server.badge import key_of
from race_server.errors import SeatError, WireError
from race_server.fleet import Fleet, Placements
from race_server.kernels.jit import bind
from race_server.messages import (
    Button,
    Control,
    Doubt,
    Event,
    EventKind,
    Flag,
    Phase,
    Pose,
    Standing,
    Status,
)
from race_server.observe import PRESETS, Layout, layout_of
from race_server.scenario.base import ABSENT, Scenario, line_up_race, make_world
from race_server.serials import Granted, Serials
from race_server.silence import AWAY_TICKS, STOP, Silence, control_under, grace_of, silence_after
from race_server.stages.observation import observe_karts
from race_server.stages.standings import rank
from race_server.state import Float32s, Floats, Ints, World, digest
from race_server.step import advance, place_karts

# Late joiners are told of so many events.
RECENT_EVENTS = 256
# Why a seat is closed; the place of each is the value of the act that closes it.
CLOSED_FOR = ("by the steward", "the steward sent its driver away")


@dataclass
class Seat:
    """One place in the race and who holds it."""

    number: int
    driver: str = ""
    preset: str = ""
    key: bytes = b""  # follows from the driver's secret
    is_taken: bool = False
    is_ready: bool = False
    is_present: bool = False
    is_tracked: bool = False  # a real kart: it sends poses instead of controls
    control: Control = STOP
    control_tick: int = -1  # tick at which the control arrived
    answered_tick: int = -1  # tick of the observation that it answers
    sequence: int = 0  # of the newest control taken
    away_since: int = -1
    silence: Silence = Silence.FRESH  # how the driver's silence acts on the kart

    def fits(self, secret: int) -> bool:
        """Return whether a secret is that of the seat's driver."""
        return secrets.compare_digest(self.key, key_of(secret))


@dataclass(frozen=True, eq=False)
class Inputs:
    """The controls that act from a tick on, of those seats whose control changed."""

    tick: int
    seats: Ints  # (n,)
    controls: Float32s  # (n, 4) steering, throttle, brake, buttons
    sequences: Ints  # (n,) of the drivers' messages


# What acts on a race, in the order in which it does.
Entry = Inputs | Placements | Act | Granted


@dataclass
class Session:
    """One race session on one scenario; it may be run again and again, an epoch each time."""

    name: str
    scenario: Scenario
    decision_ticks: int = 3
    phase: Phase = Phase.LOBBY
    epoch: int = 0
    seats: list[Seat] = field(default_factory=list)
    takes_tracked: bool = True  # where the world waits for drivers no real kart can take part
    world: World = field(init=False)
    fleet: Fleet = field(init=False)
    recent: deque[Event] = field(default_factory=lambda: deque(maxlen=RECENT_EVENTS))
    laps_us: dict[int, list[int]] = field(default_factory=dict)
    is_recorded: bool = False
    log: list[Entry] = field(default_factory=list)  # while recorded; who records empties it
    closed: dict[int, str] = field(default_factory=dict)  # seats that nobody may take, and why
    serials: Serials = field(default_factory=Serials)  # of requests that were granted
    is_paused: bool = False  # the clock stands

    def __post_init__(self) -> None:
        """Build the world once; each start puts it back."""
        self.seats = [Seat(number) for number in range(self.scenario.karts)]
        self.world = make_world(self.scenario)
        self.fleet = Fleet(self.scenario.course)
        self._controls: Floats = np.zeros((1, self.scenario.karts, 4))
        self._loaded: Float32s = np.zeros((self.scenario.karts, 4), np.float32)
        self._advances: dict[int, Callable[[], None]] = {}
        names = list(PRESETS)
        self._layouts: list[Layout] = [layout_of(name, self.scenario.lidar.rays) for name in names]
        longest = max(len(layout.numbers) for layout in self._layouts)
        self._parts = np.full((len(names), longest), -1, np.int64)
        for row, layout in zip(self._parts, self._layouts, strict=True):
            row[: len(layout.numbers)] = layout.numbers
        self._presets = np.full(self.scenario.karts, -1, np.int64)
        size = max(layout.size for layout in self._layouts)
        self._views: Float32s = np.zeros((1, self.scenario.karts, size), np.float32)

    # Seats

    def join(
        self,
        driver: str,
        preset: str,
        *,
        wanted: int = -1,
        secret: int = 0,
        tracked: bool = False,
        owns: bool = False,
    ) -> Seat:
        """Give a driver a seat, or the one that it already has.

        secret: chosen by the driver; who sends the same one again is given the same seat, so a
        join whose answer was lost may simply be repeated. owns: the wanted seat is known to be
        the driver's, which may then take it up with a new secret once its old link is gone.
        tracked: a real kart, which exists.

        Raises:
            SeatError: no seat is free, the wanted one is taken, the race has begun, or no real
                kart can take part.
        """
        if preset not in PRESETS:
            known = ", ".join(PRESETS)
            raise SeatError(f"observation {preset!r} is unknown; choose one of {known}")
        for own in self.seats:
            if secret and own.is_taken and own.fits(secret) and wanted in {-1, own.number}:
                self.come_back(own.number)
                return own
        if owns and self._is_deserted(wanted, preset):
            self.seats[wanted].key = key_of(secret)
            self.come_back(wanted)
            return self.seats[wanted]
        if owns and 0 <= wanted < len(self.seats) and self.seats[wanted].is_present:
            raise SeatError(f"seat {wanted} is in use: somebody is logged in with its keys already")
        if self.phase is not Phase.LOBBY:
            if wanted in self.closed:
                raise SeatError(f"seat {wanted} is closed: {self.closed[wanted]}")
            raise SeatError("the race has begun; join again in the next lobby")
        if tracked and not self.takes_tracked:
            raise SeatError("a real kart cannot wait for others; serve with --pace real")
        seat = self._free_seat(wanted)
        seat.driver, seat.preset = driver, preset
        seat.key = key_of(secret or secrets.randbits(63) | 1)
        seat.is_taken, seat.is_ready, seat.is_present = True, False, True
        seat.is_tracked = tracked
        if tracked:
            self.fleet.admit(seat.number, self.scenario.vehicle_of(seat.number))
        return seat

    def _is_deserted(self, number: int, preset: str) -> bool:
        """Return whether a seat races without its driver, who would see what is seen there."""
        if not 0 <= number < len(self.seats) or number in self.closed:
            return False
        seat = self.seats[number]
        return seat.is_taken and not seat.is_present and seat.preset == preset

    def _free_seat(self, wanted: int) -> Seat:
        if wanted >= 0:
            self._check_number(wanted)
        if wanted in self.closed:
            raise SeatError(f"seat {wanted} is closed: {self.closed[wanted]}")
        if wanted >= 0 and self.seats[wanted].is_taken:
            raise SeatError(f"seat {wanted} is taken by {self.seats[wanted].driver}")
        free = [s for s in self.seats if not s.is_taken and s.number not in self.closed]
        if not free:
            shut = f" or closed ({len(self.closed)})" if self.closed else ""
            raise SeatError(f"all {len(self.seats)} seats are taken{shut}")
        return self.seats[wanted] if wanted >= 0 else free[0]

    def seat(self, number: int) -> Seat:
        """Return a taken seat.

        Raises:
            SeatError: nobody sits there.
        """
        if not 0 <= number < len(self.seats) or not self.seats[number].is_taken:
            raise SeatError(f"seat {number} is not taken")
        return self.seats[number]

    def leave(self, number: int) -> None:
        """Free a seat in the lobby; in a race its kart stops and is out."""
        seat = self.seat(number)
        if self.phase in {Phase.COUNTDOWN, Phase.RUNNING}:
            self.do(ActKind.WITHDRAW, number)
            seat.is_present = False
            seat.control = STOP
        else:
            self._free(number)

    def _free(self, number: int) -> None:
        self.seats[number] = Seat(number)
        self.fleet.dismiss(number)

    def drop(self, number: int) -> None:
        """Take note that a driver's link is gone: its kart is brought to a safe stop."""
        seat = self.seats[number]
        if not seat.is_taken:
            return
        if self.phase is Phase.LOBBY:
            self._free(number)
        elif seat.is_present:
            seat.is_present = False
            seat.away_since = self.tick

    def close(self, number: int) -> None:
        """Let nobody take a seat; who has it keeps it."""
        self._check_number(number)
        self.do(ActKind.CLOSE, number, 0.0)

    def unclose(self, number: int) -> None:
        """Let a seat be taken again."""
        self._check_number(number)
        self.do(ActKind.OPEN, number)

    def kick(self, number: int) -> None:
        """Take a seat from its driver, who may not come back."""
        self.do(ActKind.CLOSE, self.seat(number).number, 1.0)
        self.leave(number)

    def stand_still(self, *, stands: bool) -> None:
        """Stop the clock of the race, or let it go on; whoever lets time pass obeys."""
        self.do(ActKind.CLOCK, value=float(stands))

    def grant(self, secret: int, serial: int) -> None:
        """Take note of a request that was granted, so that copies of it are refused."""
        self.serials.note(key_of(secret), serial)
        if self.is_recorded:
            self.log.append(Granted(self.tick, key_of(secret), serial))

    def _check_number(self, number: int) -> None:
        if not 0 <= number < len(self.seats):
            raise SeatError(f"seat {number} does not exist; seats are 0 to {len(self.seats) - 1}")

    def come_back(self, number: int) -> None:
        """Take note that a driver is there again."""
        seat = self.seat(number)
        seat.is_present = True
        seat.away_since = -1

    # The race

    @property
    def tick(self) -> int:
        """The tick that comes next."""
        return int(self.world.races[0].tick)

    def can_start(self) -> bool:
        """Return whether somebody sits in the lobby and everybody there is ready."""
        taken = [seat for seat in self.seats if seat.is_taken]
        return self.phase is Phase.LOBBY and bool(taken) and all(s.is_ready for s in taken)

    def start(self, now_us: int = 0) -> None:
        """Put the karts on the grid and begin the countdown of a new epoch.

        now_us: the time of the clock by which real karts are followed.
        """
        self.epoch += 1
        self.recent.clear()
        self.log.clear()
        self.is_paused = False
        self._controls[:] = 0.0
        self._loaded[:] = 0.0
        self.laps_us = {seat.number: [] for seat in self.seats}
        fitted = tuple(_sensors_for(seat) for seat in self.seats)
        line_up_race(self.world, 0, replace(self.scenario, fitted=fitted), self.scenario.seed)
        names = list(PRESETS)
        for seat in self.seats:
            seat.control, seat.control_tick, seat.answered_tick = STOP, -1, -1
            seat.sequence, seat.away_since, seat.silence = 0, -1, Silence.FRESH
            self._presets[seat.number] = names.index(seat.preset) if seat.is_taken else -1
        self.fleet.begin(self.world, now_us)
        self._turn(Phase.COUNTDOWN)

    def reopen(self) -> None:
        """Go back to the lobby after a race; the seats of those who have gone are free."""
        for number, seat in enumerate(self.seats):
            seat.is_ready = False
            if not seat.is_present:
                self._free(number)
        self._turn(Phase.LOBBY)

    def take_control(
        self, number: int, epoch: int, sequence: int, tick: int, control: Control
    ) -> None:
        """Take the newest control of a seat.

        Raises:
            WireError: it belongs to another epoch, is a replay, or answers the future.
        """
        seat = self.seats[number]
        if seat.is_tracked:
            raise WireError(f"control of seat {number}, which is a real kart: it sends poses")
        self._check(seat, "control", epoch, sequence)
        if tick > self.tick:
            raise WireError(f"control answers tick {tick}, this is tick {self.tick}")
        seat.sequence, seat.answered_tick = sequence, tick
        seat.control, seat.control_tick = control, self.tick
        if seat.is_present:
            seat.away_since = -1

    def _check(self, seat: Seat, what: str, epoch: int, sequence: int) -> None:
        if not seat.is_taken or epoch != self.epoch:
            raise WireError(f"{what} for epoch {epoch}, this is epoch {self.epoch}")
        if sequence <= seat.sequence:
            raise WireError(f"{what} {sequence} again, already at {seat.sequence}")

    def take_pose(
        self,
        number: int,
        epoch: int,
        sequence: int,
        pose: Pose,
        *,
        arrived_us: int,
        acknowledged: int = 0,
        buttons: Button = Button.NONE,
    ) -> Doubt:
        """Take a pose of a real kart and return what speaks against it.

        Raises:
            WireError: the kart is simulated, or the pose of another epoch or a replay.
        """
        seat = self.seats[number]
        if not seat.is_tracked:
            raise WireError(f"pose of seat {number}, whose kart is simulated: it sends controls")
        self._check(seat, "pose", epoch, sequence)
        seat.sequence = sequence
        # The kart moves by its poses; of a control only the buttons are left.
        seat.control, seat.control_tick = replace(STOP, buttons=buttons), self.tick
        if seat.is_present:
            seat.away_since = -1
        self.fleet.orders(number).acknowledge(acknowledged, arrived_us)
        return self.fleet.take(number, pose, arrived_us)

    def follow(self, now_us: int) -> None:
        """Put the real karts where they are at this time, right before a tick."""
        if self.fleet.trackers:
            self.place_karts(self.fleet.follow(self.world, now_us))

    def place_karts(self, placements: Floats) -> None:
        """Put karts into the world. placements: (n, 10), see state.PLACEMENT.

        All that real karts do to the world goes through here: the same placements before the same
        ticks give the same race.
        """
        if not len(placements):
            return
        if self.is_recorded:
            self.log.append(self.fleet.placed(self.tick, placements))
        place_karts(self.world, 0, placements)

    def waits_for(self) -> list[int]:
        """Return the racing seats that have not yet answered the observation of this tick."""
        statuses = self.world.karts["status"][0]
        return [
            seat.number
            for seat in self.seats
            if seat.is_present
            and seat.is_taken
            and statuses[seat.number] == codes.RACING
            and seat.answered_tick < self.tick
        ]

    def advance(self, ticks: int = 1) -> list[Event]:
        """Move the race on and return what happened.

        The same control acts for all `ticks`; see `race_server.silence` for karts whose driver
        is not heard.
        """
        now = self.tick
        for seat in self.seats:
            if seat.is_taken:
                self._load_control(seat, now)
        changed = np.flatnonzero((self._loaded != self._controls[0]).any(axis=1))
        if len(changed):
            self._controls[0] = self._loaded
            if self.is_recorded:
                sequences = np.array([self.seats[number].sequence for number in changed])
                self.log.append(Inputs(now, changed, self._loaded[changed], sequences))
        return self._move(ticks)

    def do_again(self, entry: Entry) -> None:
        """Let something act that a recording holds."""
        if isinstance(entry, Inputs):
            self._drive_again(entry)
        elif isinstance(entry, Placements):
            place_karts(self.world, 0, entry.rows)
            self.fleet.recall(entry)
        elif isinstance(entry, Act):
            self._carry_out(entry)
        else:
            self.serials.note(entry.key, entry.serial)

    def _drive_again(self, inputs: Inputs) -> None:
        """Let the controls of a recording act from this tick on."""
        self._controls[0, inputs.seats] = inputs.controls
        for seat, sequence in zip(inputs.seats, inputs.sequences, strict=True):
            self.seats[seat].sequence = int(sequence)

    def move_again(self, ticks: int) -> list[Event]:
        """Move the race on under the controls of a recording, and return what happened."""
        return self._move(ticks)

    def _move(self, ticks: int) -> list[Event]:
        if ticks not in self._advances:
            self._advances[ticks] = bind(advance, self.world, self._controls, ticks)
        self._advances[ticks]()
        events = self.take_events()
        if self.phase is Phase.COUNTDOWN and self.tick > self.world.races[0].start_tick:
            events.append(self._turn(Phase.RUNNING))
        if self.phase is Phase.RUNNING and self.world.races[0].over:
            events.append(self._turn(Phase.FINISHED))
        return events

    def _load_control(self, seat: Seat, now: int) -> None:
        racing = self.world.karts["status"][0, seat.number] == codes.RACING
        if racing and 0 <= seat.away_since <= now - AWAY_TICKS:
            self.do(ActKind.WITHDRAW, seat.number)
            seat.away_since, racing = -1, False
        # A control that came after a link was gone shows that the driver is there.
        is_linked = seat.is_present or seat.control_tick > seat.away_since
        overdue = now - seat.control_tick - self.decision_ticks
        length = self.scenario.vehicle_of(seat.number).length
        speed = self.world.karts["speed"][0, seat.number]
        grace = grace_of(speed, length) if seat.control_tick >= 0 else 0
        silence = silence_after(overdue - grace, is_linked=is_linked)
        # A kart that slows down unheard must not be given its grace anew, and drive off again.
        seat.silence = silence if overdue <= 0 and is_linked else max(seat.silence, silence)
        hangs = racing and seat.silence is Silence.STOPPED and seat.control_tick >= 0
        hangs = hangs and not seat.is_tracked  # of real karts the fleet knows more
        if hangs and seat.away_since < 0:  # its link is there, but it answers no more
            seat.away_since = now
        # Nobody waits for the answers of a kart that is through: they must not matter.
        control = control_under(seat.silence, seat.control) if racing else STOP
        if seat.is_tracked and seat.silence is not Silence.FRESH:
            control = STOP  # it moves by its poses: there is nothing to let coast
        # As on the wire, so that a recording holds exactly what acted.
        self._loaded[seat.number] = (
            control.steering,
            control.throttle,
            control.brake,
            int(control.buttons),
        )

    def show_flag(self, flag: Flag) -> None:
        """Show a flag to all karts."""
        self.do(ActKind.FLAG, value=float(flag))

    def penalise(self, number: int, seconds: float) -> None:
        """Add a penalty to the race time of a seat.

        Raises:
            SeatError: nobody sits there.
        """
        self.do(ActKind.PENALTY, self.seat(number).number, seconds)

    def penalise_late(self, number: int, seconds: float) -> list[Event]:
        """Add a penalty to a race that is over, rank its karts anew, return what happened.

        The recording of the race is closed, so this act is in none.
        """
        carry_out(self.world, Act(self.tick, ActKind.PENALTY, number, seconds))
        rank(self.world, 0)
        return self.take_events()

    def do(self, kind: ActKind, kart: int = -1, value: float = 0.0) -> None:
        """Do something to the race from outside, and log it."""
        act = Act(self.tick, kind, kart, value)
        if self.is_recorded:
            self.log.append(act)
        self._carry_out(act)

    def _carry_out(self, act: Act) -> None:
        carry_out(self.world, act)
        if act.kind is ActKind.CLOSE:
            self.closed[act.kart] = CLOSED_FOR[bool(act.value)]
            if act.value:
                self.seats[act.kart].key = b""
        elif act.kind is ActKind.OPEN:
            self.closed.pop(act.kart, None)
        elif act.kind is ActKind.CLOCK:
            self.is_paused = bool(act.value)

    def log_what_holds(self) -> None:
        """Log what was decided before the race began and still holds."""
        for number, reason in self.closed.items():
            value = float(CLOSED_FOR.index(reason))
            self.log.append(Act(self.tick, ActKind.CLOSE, number, value))
        self.log.extend(self.serials.granted(self.tick))

    def take_events(self) -> list[Event]:
        """Return the events since the last call and remember them for late comers."""
        count = int(self.world.event_counts[0])
        events = [
            Event(
                int(row.sequence),
                int(row.tick),
                EventKind(row.kind),
                int(row.kart),
                int(row.other),
                int(row.value),
            )
            for row in self.world.events[0][:count]
        ]
        self.world.event_counts[0] = 0
        for event in events:
            if event.kind is EventKind.LAP:
                self.laps_us[event.kart].append(event.value)
        self.recent.extend(events)
        return events

    def _turn(self, phase: Phase) -> Event:
        self.phase = phase
        race = self.world.races[0]
        race.sequence += 1
        event = Event(int(race.sequence), int(race.tick), EventKind.PHASE, -1, int(phase), 0)
        self.recent.append(event)
        return event

    # What others are told

    def look(self) -> None:
        """Work out what every seat sees now; read it with `view`."""
        observe_karts(self.world, self._parts, self._presets, self._views)

    def view(self, number: int) -> Float32s:
        """Return the observation vector of a seat as of the last `look`."""
        layout = self._layouts[int(self._presets[number])]
        return self._views[0, number, : layout.size]

    def layout(self, preset: str) -> Layout:
        """Return the layout of a preset in this session."""
        return layout_of(preset, self.scenario.lidar.rays)

    def digest(self) -> str:
        """Return the digest of the world."""
        return digest(self.world)

    def standings(self) -> list[Standing]:
        """Return one row for each taken seat, best place first."""
        rows = [row for row in self.table() if self.seats[row.seat].is_taken]
        return sorted(rows, key=lambda row: row.rank)

    def table(self) -> list[Standing]:
        """Return one row for each seat, whether or not somebody still sits there."""
        return [self._standing(seat) for seat in self.seats]

    def _standing(self, seat: Seat) -> Standing:
        karts = self.world.karts[0]
        kart = karts[seat.number]
        leader = karts[int(np.argmin(np.where(karts["rank"] > 0, karts["rank"], 999)))]
        race_us = int(kart.finish_us + kart.penalty_us) if kart.status == codes.FINISHED else 0
        gap_us = 0
        if race_us and leader.status == codes.FINISHED:
            gap_us = race_us - int(leader.finish_us + leader.penalty_us)
        return Standing(
            seat=seat.number,
            driver=seat.driver,
            rank=int(kart["rank"]),
            laps=int(kart.laps),
            status=Status(int(kart.status)),
            last_lap_us=int(kart.last_lap_us),
            best_lap_us=int(kart.best_lap_us),
            race_time_us=race_us,
            gap_us=gap_us,
            penalties=int(kart.penalties),
            penalty_us=int(kart.penalty_us),
            items_used=int(kart.items_used),
            lap_times_us=tuple(self.laps_us.get(seat.number, ())),
        )


def _sensors_for(seat: Seat) -> int:
    """Return the sensors that a seat's observation needs."""
    if not seat.is_taken:
        return ABSENT
    parts = PRESETS[seat.preset]
    sensors = codes.LIDAR if "lidar" in parts else 0
    return sensors | (codes.RADAR if "radar" in parts else 0)
