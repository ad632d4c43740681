"""A session with a real kart that drives in a circle."""

import math
from dataclasses import replace

from race_server.core.messages import (
    Button,
    EventKind,
    Pose,
    PoseFault,
)
from race_server.scenario.race import Rules, Scenario
from race_server.session.session import Session
from support.courses import ring

RADIUS = 10.0

COURSE = ring(radius=RADIUS, half_width=2.0)

TICK_US = 1_000_000 / 60


class Real:
    """A real kart that drives in a circle over a perfect link; told when to misbehave."""

    def __init__(self, session: Session, seat: int = 0, speed: float = 3.0) -> None:
        self.session, self.seat, self.speed = session, seat, speed
        self.x, self.y, self.heading = (float(v) for v in session.scenario.course.grid[seat])
        self.angle = math.atan2(self.y, self.x)
        self.sequence = 0

    def pose(self, now_us: float) -> Pose:
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        rate = self.speed / RADIUS
        heading = math.remainder(self.angle + math.pi / 2, 2 * math.pi)
        where = (RADIUS * cos, RADIUS * sin, heading)
        return Pose(round(now_us), *where, self.speed, yaw_rate=rate)

    def send(self, pose: Pose, buttons: Button = Button.NONE) -> PoseFault:
        self.sequence += 1
        return self.session.receive_pose(
            self.seat,
            self.session.epoch,
            self.sequence,
            pose,
            arrived_us=pose.stamp_us,
            acknowledged=self.session.tracked_karts.orders(self.seat).sequence,
            buttons=buttons,
        )


def mixed(karts: int = 2, **rules: object) -> tuple[Session, Real]:
    """Return a session at the green light with a real kart on the first seat."""
    scenario = Scenario(COURSE, karts=karts, rules=Rules(laps=1, countdown_s=0.5, **rules))  # type: ignore[arg-type]
    session = Session("test", scenario)
    session.join("real", "track", tracked=True)
    for number in range(1, karts):
        session.join(f"simulated {number}", "track")
    session.start()
    real = Real(session)
    real.speed = 0.0
    drive(session, real, 31)
    real.speed = 3.0
    return session, real


def drive(
    session: Session, real: Real, ticks: int, *, silent: bool = False, moved: float = 0.0
) -> list[EventKind]:
    """Let ticks pass; return what happened to the real kart."""
    events = []
    for _ in range(ticks):
        now_us = session.tick * TICK_US
        real.angle += real.speed / RADIUS / 60.0
        pose = real.pose(now_us)
        if not silent:
            real.send(replace(pose, x=pose.x + moved))
        session.follow(round(now_us))
        events += [event.kind for event in session.advance(1) if event.kart == real.seat]
    return events
