"""Two servers, one race: karts of each session drive in the other one as well.

Each site has its own server, world and rules, and trusts no other server. A bridge connects to both
as a spectator: the pose of a kart at its own site is sent to the other site as that of a tracked
real kart, on a seat that was kept for it. There it is a rival: it is ranked and overtaken, and a
contact with it is one with a real kart, which moves as it reports and not as it is pushed. It obeys
only the flags and effects of the site that it comes from.
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
from race_server.live.client.timing import BridgeTiming
from race_server.net.auth.access import SPECTATOR, seat_name
from race_server.net.auth.keys import ClientKeys, read_client_keys
from race_server.net.transport import ClientLink, Mailbox
from race_server.net.wire import topics
from race_server.net.wire.drive import HudFrame, decode_hud
from race_server.net.wire.lobby import CourseSheet, Join, decode_course
from race_server.net.wire.pose import PoseFrame, encode_pose
from race_server.net.wire.spectate import SnapshotFrame, decode_snapshot, decode_standings
from race_server.net.wire.strict import MOST_NAME

_OVER = frozenset({Phase.FINISHED, Phase.LOBBY})


@dataclass(frozen=True)
class Site:
    """A served session, and which of its seats are kept for karts of the other site."""

    address: str
    session: str
    ghosts: tuple[int, ...]  # seats, with the same numbers as at the karts' own site
    keys: Path | None = None  # folder with the keys of a spectator and of each ghost's seat

    def keys_of(self, role: str) -> ClientKeys | None:
        """Return the keys of a role, None at a site without keys."""
        return read_client_keys(self.keys / role, self.session) if self.keys else None


@dataclass
class GhostKart:
    """A kart of the other site on its seat at this one."""

    seat: ClientSeat
    hud: HudFrame | None = None
    received_us: int = 0
    sequence: int = 0
    poses: int = 0
    misses: list[float] = field(default_factory=list)  # [m] between its positions at the two sites

    def receive_hud(self, data: bytes) -> None:
        """Record the newest heads-up data of the seat, which poses must acknowledge."""
        with suppress(WireError):
            self.hud, self.received_us = decode_hud(data), _now_us()

    def send_pose(self, row: Any, stamp_us: int) -> None:
        """Send the pose of the kart at its own site; nothing before the first heads-up data.

        row: of that site's snapshot; stamp_us: by the clock of that site.
        """
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
            echo_us=hud.monotonic_us + _now_us() - self.received_us,
        )
        frame = PoseFrame(hud.epoch, self.sequence, hud.sequence, pose)
        self.seat.send(encode_pose(frame))

    def figures(self) -> dict[str, Any]:
        """Return the figures of the kart at this site, as plain data."""
        misses = sorted(self.misses) or [math.nan]
        return {
            "seat": self.seat.number,
            "poses": self.poses,
            "miss_median_m": round(misses[len(misses) // 2], 3),
            "miss_p99_m": round(misses[int(0.99 * (len(misses) - 1))], 3),
        }


class RemoteSite:
    """One end of the bridge."""

    def __init__(self, site: Site, stack: ExitStack, deadline: float, timing: BridgeTiming) -> None:
        """Connect as a spectator. Links close with `stack`.

        Raises:
            LinkError: the server does not answer until the deadline.
        """
        self.site = site
        self._stack, self._deadline, self._timing = stack, deadline, timing
        self._spectator = self._connect(SPECTATOR)
        self.mailbox = Mailbox()
        self._spectator.listen(topics.SNAPSHOT, self.mailbox.put)
        self.newest: SnapshotFrame | None = None
        self.received_s = time.monotonic()
        self.has_raced = False
        self.ghosts: dict[int, GhostKart] = {}

    def _connect(self, role: str) -> ClientLink:
        keys = self.site.keys_of(role)
        link = partial(ClientLink, self.site.address, self.site.session, keys=keys, timeout_s=1.0)
        return self._stack.enter_context(insist(link, self._deadline))

    def course(self) -> CourseSheet:
        """Return the course of the site."""
        return decode_course(insist(partial(self._spectator.ask, topics.COURSE), self._deadline))

    def names(self) -> dict[int, str]:
        """Return the names of the drivers, by seat."""
        table = decode_standings(insist(partial(self._spectator.ask, topics.TABLE), self._deadline))
        return {row.seat: row.driver for row in table.rows}

    def take_seats_for(self, other: "RemoteSite") -> None:
        """Take the seats that are kept for karts of the other site."""
        names = other.names()
        for number in self.site.ghosts:
            name = f"{names.get(number, f'kart {number}')}@{other.site.session}"[:MOST_NAME]
            link = self._connect(seat_name(number))
            join = Join(name, "track", number, tracked=True)
            seat = insist(partial(take_seat, link, join), self._deadline)
            ghost = self.ghosts[number] = GhostKart(seat)
            link.listen(topics.HUD, ghost.receive_hud, number)

    def get_ready(self) -> None:
        """Report all ghosts ready."""
        for ghost in self.ghosts.values():
            insist(partial(ghost.seat.act, topics.READY), self._deadline)

    def poll(self) -> SnapshotFrame | None:
        """Return the newest snapshot, None where it was returned before."""
        data = self.mailbox.take(0.0)
        with suppress(WireError):
            if data is not None:
                self.newest, self.received_s = decode_snapshot(data), time.monotonic()
                self.has_raced |= self.newest.phase not in _OVER
                return self.newest
        return None

    @property
    def is_over(self) -> bool:
        """Whether its race is over, or its server gone."""
        silent = self.has_raced and self._is_silent()
        ended = self.newest is not None and self.newest.phase in _OVER
        return silent or (self.has_raced and ended)

    def check(self) -> None:
        """Ask the server whether it is there if it is silent before the race: a lobby may be.

        Raises:
            LinkError: it has gone.
        """
        if not self.has_raced and self._is_silent():
            self.received_s = time.monotonic()
            self._deadline = self.received_s + self._timing.snapshot_timeout_s
            self.names()

    def _is_silent(self) -> bool:
        return time.monotonic() - self.received_s > self._timing.snapshot_timeout_s

    def release_seats(self) -> None:
        """Give the ghosts' seats up: a kart that has not finished retires."""
        for ghost in self.ghosts.values():
            with suppress(LinkError, SeatError):
                ghost.seat.act(topics.LEAVE)


def relay(
    first: Site,
    second: Site,
    *,
    timeout_s: float = 20.0,
    on_seated: Callable[[], None] = lambda: None,
    timing: BridgeTiming | None = None,
) -> dict[str, Any]:
    """Connect two sites for one race; return the figures of each ghost, by session.

    timeout_s: for both servers to answer [s]; on_seated: is called once all ghosts have seats.

    Raises:
        LinkError: a site does not answer.
        SeatError: a seat that was to be kept is taken.
        RaceError: the sites do not race on the same course.
    """
    timing = timing or BridgeTiming()
    deadline = time.monotonic() + timeout_s
    with ExitStack() as stack:
        sites = [RemoteSite(site, stack, deadline, timing) for site in (first, second)]
        _check_courses(sites)
        sites[0].take_seats_for(sites[1])
        sites[1].take_seats_for(sites[0])
        on_seated()
        for end in sites:
            end.get_ready()
        _forward_all(sites, timing)
        return {end.site.session: [g.figures() for g in end.ghosts.values()] for end in sites}


def _check_courses(sites: list[RemoteSite]) -> None:
    sheets = [end.course() for end in sites]
    if sheets[0].digest != sheets[1].digest:
        raise RaceError(
            f"the sites race on different courses, {sheets[0].name!r} and {sheets[1].name!r}: "
            "serve both on the same one"
        )


def _forward_all(sites: list[RemoteSite], timing: BridgeTiming) -> None:
    """Send the poses of each site's karts to the other site, until both races are over."""
    counts, released = [0, 0], [False, False]
    while not all(end.is_over for end in sites):
        for number, end in enumerate(sites):
            end.check()
            frame = end.poll()
            other = sites[1 - number]
            if frame is not None:
                counts[number] += 1
                if counts[number] % timing.snapshots_per_pose == 0:
                    _forward(frame, other)
            if end.is_over and not released[number]:
                released[number] = True
                other.release_seats()
        time.sleep(timing.poll_s)


def _forward(frame: SnapshotFrame, other: RemoteSite) -> None:
    """Send the poses of a snapshot to the ghosts at the other site."""
    for number, ghost in other.ghosts.items():
        row = _row_of(frame, number)
        if row is None:
            continue
        ghost.send_pose(row, frame.monotonic_us)
        there = _row_of(other.newest, number) if other.newest else None
        if there is not None and frame.phase is Phase.RUNNING and row["status"] == Status.RACING:
            ghost.misses.append(math.hypot(row["x"] - there["x"], row["y"] - there["y"]))


def _row_of(frame: SnapshotFrame, seat: int) -> Any | None:
    found = np.flatnonzero(frame.karts["seat"] == seat)
    return frame.karts[found[0]] if len(found) else None


def _now_us() -> int:
    return time.monotonic_ns() // 1000
