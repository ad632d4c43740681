"""What the two sides of a kart tell each other, as bytes.

The game's side tells what the server wants and what the driver does; the safety side tells where
the kart is and what it sees. Numbers are kept as they are: 64 bits each.
"""

import struct
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.orders import GivenOrders, Orders
from race_agents.unit.readings import MOST_RAYS
from race_server.core.alert import Advice, Alert, Cause, Danger, DangerStage
from race_server.core.messages import Button, Control, Flag, Pose, RayHit, Source, Trust
from race_server.core.peer import Peer
from race_server.core.telemetry import Health, SensorState

Floats = NDArray[np.float64]

# has orders, flag, trust, peers; epoch, tick, sequence, buttons, decisions; the server's clock
# [µs]; cap, thrust, grip, validity, lights, when they were heard; steering, throttle, brake.
WORD = struct.Struct("<4BIIIIIQ6d3d")
PEER = struct.Struct("<q11d")  # as the fields of a `Peer`
MOST_TOLD = 16  # peers in a word
MOST_WORD = WORD.size + MOST_TOLD * PEER.size
# has a pose, source, stage, kind, advice, cause, is through, is cut; buttons, rays; stamps of the
# pose and of the alert, what the server's clock was [µs]; the pose; the danger; the sensors; the
# heading's deviation, the link's age and the battery, below 0 where they are not known; braking.
REPORT = struct.Struct("<8BIIQQQ9d4d8B4d")
IDLE, QUIET = Control(brake=1.0), Alert(0)
MOST_REPORT = REPORT.size + 8 * MOST_RAYS


def _or_below(*values: float | None) -> tuple[float, ...]:
    return tuple(-1.0 if value is None else value for value in values)


def _known(*values: float) -> tuple[float | None, ...]:
    return tuple(None if value < 0.0 else value for value in values)


@dataclass(frozen=True)
class Word:
    """What the game's side tells."""

    orders: Orders | None = None  # the newest ones of the server
    heard_s: float = 0.0  # when they came, by the kart's clock
    control: Control = IDLE  # the driver's newest decision
    decisions: int = 0  # how many there were so far
    peers: tuple[Peer, ...] = ()  # other real karts, their stamps by the kart's clock

    def pack(self) -> bytes:
        """Return it as bytes."""
        orders = self.orders or GivenOrders(0.0, 0.0)
        control, peers = self.control, self.peers[:MOST_TOLD]
        head = WORD.pack(
            *(self.orders is not None, int(orders.flag), int(orders.trust), len(peers)),
            *(orders.epoch, orders.tick, orders.sequence, int(control.buttons), self.decisions),
            *(orders.monotonic_us, orders.speed_cap, orders.thrust_scale, orders.grip_scale),
            *(orders.valid_s, orders.lights_s, self.heard_s),
            *(control.steering, control.throttle, control.brake),
        )
        return head + b"".join(PEER.pack(*astuple(peer)) for peer in peers)

    @staticmethod
    def unpack(data: bytes) -> "Word":
        """Return what `pack` wrote."""
        has_orders, flag, trust, count, *numbers = WORD.unpack_from(data)
        epoch, tick, sequence, buttons, decisions, *rest = numbers
        peers = PEER.iter_unpack(data[WORD.size : WORD.size + count * PEER.size])
        clock_us, cap, thrust, grip, valid_s, lights_s, heard_s, steering, throttle, brake = rest
        orders = GivenOrders(
            *(cap, thrust, epoch, tick, sequence, grip, valid_s, clock_us, lights_s),
            *(Flag(flag), Trust(trust)),
        )
        control = Control(steering, throttle, brake, Button(buttons))
        told = tuple(Peer(*row) for row in peers)
        return Word(orders if has_orders else None, heard_s, control, decisions, told)


UNKNOWN = Health()


@dataclass(frozen=True, eq=False)
class Report:
    """What the safety side tells."""

    pose: Pose | None = None  # of the centre of gravity; None before the first fix
    alert: Alert = QUIET
    buttons: Button = Button.NONE
    ranges: Floats | None = None  # [m] of the lidar's rays
    health: Health = UNKNOWN
    is_through: bool = False  # the kart has nothing more to do
    is_cut: bool = False  # as if the radio were off
    braking: float = 0.0  # [m/s²] that it asks of its brakes

    def pack(self) -> bytes:
        """Return it as bytes."""
        pose, danger = self.pose or Pose(0, 0.0, 0.0, 0.0, 0.0), self.alert.danger
        health = self.health
        ranges = np.zeros(0) if self.ranges is None else self.ranges
        head = REPORT.pack(
            *(self.pose is not None, int(pose.source), int(danger.stage), int(danger.kind)),
            *(int(danger.advice), int(self.alert.cause), self.is_through, self.is_cut),
            *(int(self.buttons), len(ranges)),
            *(pose.stamp_us, self.alert.stamp_us, pose.echo_us),
            *(pose.x, pose.y, pose.heading, pose.speed, pose.lateral_speed, pose.yaw_rate),
            *(pose.steering, pose.deviation, pose.quality),
            *(danger.bearing, danger.distance, danger.time_s, danger.needed),
            *(map(int, health.sensors)),
            *(health.heading_deviation, *_or_below(health.link_s, health.battery)),
            self.braking,
        )
        return head + ranges.astype("<f8").tobytes()

    @staticmethod
    def unpack(data: bytes) -> "Report":
        """Return what `pack` wrote."""
        row = REPORT.unpack_from(data)
        has_pose, source, stage, kind, advice, cause, is_through, is_cut, buttons, rays = row[:10]
        stamp_us, said_us, echo_us = row[10:13]
        bearing, distance, time_s, needed = row[22:26]
        x, y, heading, speed, lateral_speed, yaw_rate, steering, deviation, quality = row[13:22]
        pose = Pose(
            *(stamp_us, x, y, heading, speed, lateral_speed, yaw_rate),
            *(steering, deviation, quality, Source(source), echo_us),
        )
        danger = Danger(
            *(DangerStage(stage), RayHit(kind), bearing, distance, time_s, needed, Advice(advice)),
        )
        return Report(
            pose if has_pose else None,
            Alert(said_us, danger, Cause(cause)),
            Button(buttons),
            np.frombuffer(data, "<f8", rays, REPORT.size) if rays else None,
            Health(tuple(map(SensorState, row[26:34])), row[34], *_known(*row[35:37])),
            bool(is_through),
            bool(is_cut),
            row[37],
        )
