"""Two halls, one race: karts of each session drive in the other one as well.

Each hall has its own server, world and rules, and trusts no other server. A relay stands between
them, as a spectator in both: what it sees of a kart in its own hall it tells the other hall as the
poses of a real kart, on a seat that was kept for it. There it is a rival: ranked, overtaken,
touched as one touches a real kart, which moves where it says and not where it is pushed. It obeys
the flags and effects of its own hall alone.
"""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from race_server.core.messages import Phase, Pose, Source, Status
from race_server.errors import LinkError, RaceError, SeatError, WireError
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.net.auth.access import SPECTATOR, seat_name
from race_server.net.auth.keys import ClientKeys, read_client_keys
from race_server.net.transport import ClientLink, Mailbox
from race_server.net.wire import topics
from race_server.net.wire.drive import HudFrame, decode_hud
from race_server.net.wire.lobby import CourseSheet, Join, decode_course
from race_server.net.wire.pose import PoseFrame, encode_pose
from race_server.net.wire.spectate import SnapshotFrame, decode_snapshot, decode_standings

# A snapshot in so many is told on: 30 poses a second.
TELL_EVERY = 2
# Without a snapshot for so long a hall has gone.
SILENCE_S = 10.0
POLL_S = 0.004
_OVER = frozenset({Phase.FINISHED, Phase.LOBBY})


@dataclass(frozen=True)
class Site:
    """A hall, and which of its seats are kept for karts of the other one."""

    address: str
    session: str
    guests: tuple[int, ...]  # the same numbers as in their own hall
    keys: Path | None = None  # folder with those of a spectator and of each guest's seat

    def keys_of(self, role: str) -> ClientKeys | None:
        """Return the keys of a role, None in a hall without keys."""
        return read_client_keys(self.keys / role, self.session) if self.keys else None


@dataclass
class GhostKart:
    """A kart of the other hall on its seat in this one."""

    seat: ClientSeat
    hud: HudFrame | None = None
    heard_us: int = 0
    sequence: int = 0
    poses: int = 0
    misses: list[float] = field(default_factory=list)  # [m] between its places in the two halls

    def hear(self, data: bytes) -> None:
        """Take note of what the hall wants of the kart."""
        with suppress(WireError):
            self.hud, self.heard_us = decode_hud(data), _now_us()

    def tell(self, row: Any, stamp_us: int) -> None:
        """Send where the kart is in its own hall. stamp_us: by the clock of that hall."""
        hud = self.hud
        if hud is None:
            return
        self.sequence += 1
        self.poses += 1
        pose = Pose(
            stamp_us,
            x=float(row["x"]),
            y=float(row["y"]),
            heading=float(row["heading"]),
            speed=float(row["speed"]),
            lateral_speed=float(row["lateral_speed"]),
            yaw_rate=float(row["yaw_rate"]),
            steering=float(row["steering"]),
            source=Source.BEACONS,
            echo_us=hud.monotonic_us + _now_us() - self.heard_us,
        )
        frame = PoseFrame(hud.epoch, self.sequence, hud.sequence, pose)
        self.seat.send(encode_pose(frame))

    def figures(self) -> dict[str, Any]:
        """Return what became of the kart here, as plain data."""
        misses = sorted(self.misses) or [math.nan]
        return {
            "seat": self.seat.number,
            "poses": self.poses,
            "miss_median_m": round(misses[len(misses) // 2], 3),
            "miss_p99_m": round(misses[int(0.99 * (len(misses) - 1))], 3),
        }


class RemoteSite:
    """One end of the relay."""

    def __init__(self, site: Site, stack: ExitStack, deadline: float) -> None:
        """Watch a hall. Connections end with `stack`.

        Raises:
            LinkError: its server does not answer until the deadline.
        """
        self.site = site
        self._stack, self._deadline = stack, deadline
        self._watch = self._connect(SPECTATOR)
        self.mailbox = Mailbox()
        self._watch.listen(topics.SNAPSHOT, self.mailbox.put)
        self.newest: SnapshotFrame | None = None
        self.heard_s = time.monotonic()
        self.has_raced = False
        self.guests: dict[int, GhostKart] = {}

    def _connect(self, role: str) -> ClientLink:
        keys = self.site.keys_of(role)
        link = partial(ClientLink, self.site.address, self.site.session, keys=keys, timeout_s=1.0)
        return self._stack.enter_context(insist(link, self._deadline))

    def course(self) -> CourseSheet:
        """Return the course of the hall."""
        return decode_course(insist(partial(self._watch.ask, topics.COURSE), self._deadline))

    def names(self) -> dict[int, str]:
        """Return who drives here, by seat."""
        table = decode_standings(insist(partial(self._watch.ask, topics.TABLE), self._deadline))
        return {row.seat: row.driver for row in table.rows}

    def invite(self, other: "RemoteSite") -> None:
        """Take the seats that are kept for karts of the other hall."""
        names = other.names()
        for number in self.site.guests:
            name = f"{names.get(number, f'kart {number}')}@{other.site.session}"[:32]
            link = self._connect(seat_name(number))
            join = Join(name, "track", number, tracked=True)
            seat = insist(partial(take_seat, link, join), self._deadline)
            guest = self.guests[number] = GhostKart(seat)
            link.listen(topics.HUD, guest.hear, number)

    def get_ready(self) -> None:
        """Let the race begin as far as the guests are concerned."""
        for guest in self.guests.values():
            insist(partial(guest.seat.act, topics.READY), self._deadline)

    def look(self) -> SnapshotFrame | None:
        """Return the newest snapshot if there is a new one."""
        data = self.mailbox.take(0.0)
        with suppress(WireError):
            if data is not None:
                self.newest, self.heard_s = decode_snapshot(data), time.monotonic()
                self.has_raced |= self.newest.phase not in _OVER
                return self.newest
        return None

    @property
    def is_over(self) -> bool:
        """Whether its race is over, or its server gone."""
        silent = self.has_raced and time.monotonic() - self.heard_s > SILENCE_S
        ended = self.newest is not None and self.newest.phase in _OVER
        return silent or (self.has_raced and ended)

    def check(self) -> None:
        """See that the server is there while no race is on, when it has nothing to say.

        Raises:
            LinkError: it has gone.
        """
        if not self.has_raced and time.monotonic() - self.heard_s > SILENCE_S:
            self.heard_s = time.monotonic()
            self._deadline = self.heard_s + SILENCE_S
            self.names()

    def dismiss(self) -> None:
        """Give the guests' seats back: a kart that has not finished is out."""
        for guest in self.guests.values():
            with suppress(LinkError, SeatError):
                guest.seat.act(topics.LEAVE)


def relay(
    first: Site,
    second: Site,
    *,
    timeout_s: float = 20.0,
    is_ready: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Carry karts between two halls for one race; return what became of them.

    is_ready: is called once all guests have their seats.

    Raises:
        LinkError: a hall does not answer.
        SeatError: a seat that was to be kept is taken.
        RaceError: the halls do not race on the same course.
    """
    deadline = time.monotonic() + timeout_s
    with ExitStack() as stack:
        halls = [RemoteSite(site, stack, deadline) for site in (first, second)]
        _check_courses(halls)
        halls[0].invite(halls[1])
        halls[1].invite(halls[0])
        is_ready()
        for hall in halls:
            hall.get_ready()
        _carry(halls)
        return {hall.site.session: [g.figures() for g in hall.guests.values()] for hall in halls}


def _check_courses(halls: list[RemoteSite]) -> None:
    sheets = [hall.course() for hall in halls]
    if sheets[0].digest != sheets[1].digest:
        raise RaceError(
            f"the halls race on different courses, {sheets[0].name!r} and {sheets[1].name!r}: "
            "serve both on the same one"
        )


def _carry(halls: list[RemoteSite]) -> None:
    """Tell each hall where the karts of the other one are, until both races are over."""
    counts, dismissed = [0, 0], [False, False]
    while not all(hall.is_over for hall in halls):
        for place, hall in enumerate(halls):
            hall.check()
            frame = hall.look()
            other = halls[1 - place]
            if frame is not None:
                counts[place] += 1
                if counts[place] % TELL_EVERY == 0:
                    _tell(frame, other)
            if hall.is_over and not dismissed[place]:
                dismissed[place] = True
                other.dismiss()
        time.sleep(POLL_S)


def _tell(frame: SnapshotFrame, other: RemoteSite) -> None:
    """Tell the other hall where its guests are."""
    for number, guest in other.guests.items():
        row = _row_of(frame, number)
        if row is None:
            continue
        guest.tell(row, frame.monotonic_us)
        there = _row_of(other.newest, number) if other.newest else None
        if there is not None and frame.phase is Phase.RUNNING and row["status"] == Status.RACING:
            guest.misses.append(math.hypot(row["x"] - there["x"], row["y"] - there["y"]))


def _row_of(frame: SnapshotFrame, seat: int) -> Any | None:
    found = np.flatnonzero(frame.karts["seat"] == seat)
    return frame.karts[found[0]] if len(found) else None


def _now_us() -> int:
    return time.monotonic_ns() // 1000
