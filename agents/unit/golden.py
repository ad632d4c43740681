"""Golden vectors of the control unit: readings in, state and command out, as plain numbers.

A port to another language reads the inputs, runs its own unit, and must repeat the outputs to
1e-9. All that a unit knows of its kart is in the vectors: the vehicle's figures, orders, controls.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.borders import Borders
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.fence import CourseFence
from race_agents.unit.motion import SIZE
from race_agents.unit.orders import GivenOrders
from race_agents.unit.readings import Fix, Range, Readings
from race_agents.unit.safety import Echoes
from race_server.core.messages import Control, Source
from race_server.core.peer import Peer
from race_server.core.vehicles import Vehicle

Floats = NDArray[np.float64]

VERSION = 3  # 2: with borders; 3: with peers, which older files lack
# Columns of `inputs`; NaN stands for what there is none of.
INPUTS = (
    *("time", "wheel_speed", "yaw_rate", "steering", "ahead", "left"),
    *("fix_x", "fix_y", "fix_deviation", "fix_stamp", "fix_stamp_deviation", "fix_heading"),
    *("fix_heading_deviation", "fix_speed", "fix_course", "fix_speed_deviation"),
    *("beacon_x", "beacon_y", "beacon_distance", "beacon_deviation"),
    *("driver_steering", "driver_throttle", "driver_brake", "speed_cap", "thrust_scale"),
)
# … and of `outputs`; before the first fix the state is NaN.
STATE = tuple(f"state_{number}" for number in range(SIZE))
OUTPUTS = (
    *STATE,
    *("deviation", "steering", "throttle", "brake", "cause", "stage", "bearing", "needed"),
)
# Columns of `echoes`: the row of `inputs` that they belong to, and the echo. A row with a kind
# below 0 stands for a scan without echoes.
ECHOES = ("row", "x", "y", "closing", "kind")
# Columns of `peers`: the row of `inputs` in which they are heard, and what each tells.
PEERS = ("row", *(each.name for each in fields(Peer)))


@dataclass(frozen=True)
class Turn:
    """One turn of the loop: what comes in."""

    readings: Readings
    control: Control
    orders: GivenOrders
    peers: tuple[Peer, ...] = ()


def run(vehicle: Vehicle, fence: CourseFence, turns: Sequence[Turn]) -> Floats:
    """Return what the unit makes of some turns, (T, len(OUTPUTS))."""
    unit, rows = ControlUnit.of(vehicle, fence), []
    for turn in turns:
        now_s = turn.readings.time_s
        unit.sense(turn.readings)
        unit.hear(turn.orders, now_s)
        unit.drive(turn.control, now_s)
        unit.hear_peers(turn.peers)
        command = unit.decide(now_s)
        state = np.full(SIZE, math.nan) if unit.fusion is None else unit.fusion.state
        deviation = math.nan if unit.fusion is None else unit.fusion.deviation
        danger = unit.danger
        act = (command.steering, command.throttle, command.brake, float(command.cause))
        danger_row = (float(danger.stage), danger.bearing, danger.needed)
        rows.append((*state, deviation, *act, *danger_row))
    return np.array(rows)


def pack(vehicle: Vehicle, fence: CourseFence, turns: Sequence[Turn]) -> dict[str, Any]:
    """Return the arrays of a file of golden vectors."""
    echoes = [
        (row, *echo)
        for row, turn in enumerate(turns)
        if turn.readings.echoes is not None
        for echo in _rows_of(turn.readings.echoes)
    ]
    figures = {name: value for name, value in asdict(vehicle).items() if isinstance(value, float)}
    return {
        "version": np.array(VERSION),
        "vehicle_name": np.array(vehicle.name),
        "vehicle_names": np.array(list(figures)),
        "vehicle_values": np.array(list(figures.values())),
        "line": fence.line,
        "half_widths": fence.half_widths,
        "kerb": np.array(fence.kerb),
        **_borders_of(fence),
        "input_names": np.array(INPUTS),
        "inputs": np.array([_inputs_of(turn) for turn in turns]),
        "echo_names": np.array(ECHOES),
        "echoes": np.array(echoes).reshape(-1, len(ECHOES)),
        "peer_names": np.array(PEERS),
        "peers": np.array(
            [(row, *astuple(peer)) for row, turn in enumerate(turns) for peer in turn.peers],
            np.float64,
        ).reshape(-1, len(PEERS)),
        "output_names": np.array(OUTPUTS),
        "outputs": run(vehicle, fence, turns),
    }


def unpack(arrays: Any) -> tuple[CourseFence, list[Turn]]:
    """Return the fence and the turns of a file of golden vectors."""
    borders = Borders(*(arrays[f"border_{each.name}"] for each in fields(Borders)))
    fence = CourseFence(arrays["line"], arrays["half_widths"], float(arrays["kerb"]), borders)
    by_row: dict[int, list[Floats]] = {}
    for echo in arrays["echoes"]:
        by_row.setdefault(int(echo[0]), []).append(echo[1:])
    heard: dict[int, list[Peer]] = {}
    for number, stamp_us, *told in arrays["peers"].tolist() if "peers" in arrays else ():
        heard.setdefault(int(number), []).append(Peer(int(stamp_us), *told))
    names = [str(name) for name in arrays["input_names"]]
    turns = []
    for number, row in enumerate(arrays["inputs"].tolist()):
        turn = _turn_of(dict(zip(names, row, strict=True)), by_row.get(number))
        turns.append(replace(turn, peers=tuple(heard.get(number, ()))))
    return fence, turns


def _borders_of(fence: CourseFence) -> dict[str, Any]:
    assert fence.borders is not None
    return {f"border_{name}": value for name, value in vars(fence.borders).items()}


def _rows_of(echoes: Echoes) -> list[tuple[float, float, float, float]]:
    if len(echoes.x) == 0:
        return [(0.0, 0.0, 0.0, -1.0)]
    columns = (echoes.x, echoes.y, echoes.closing, echoes.kinds)
    return [tuple(map(float, row)) for row in zip(*columns, strict=True)]  # type: ignore[misc]


def _inputs_of(turn: Turn) -> tuple[float, ...]:
    readings, control = turn.readings, turn.control
    fix, none = readings.fix, math.nan
    felt = readings.acceleration or (none, none)
    located: tuple[float | None, ...] = (None,) * 10
    if fix is not None:
        located = (
            *(fix.x, fix.y, fix.deviation, fix.stamp_s, fix.stamp_deviation_s),
            *(fix.heading, fix.heading_deviation, fix.speed, fix.course, fix.speed_deviation),
        )
    beacon = (none,) * 4
    if readings.beacons:
        first = readings.beacons[0]
        beacon = (first.x, first.y, first.distance, first.deviation)
    return (
        *(readings.time_s, readings.wheel_speed, readings.yaw_rate, readings.steering, *felt),
        *(none if value is None else value for value in located),
        *beacon,
        *(control.steering, control.throttle, control.brake),
        *(turn.orders.speed_cap, turn.orders.thrust_scale),
    )


def _turn_of(told: dict[str, float], echoes: list[Floats] | None) -> Turn:
    def known(name: str) -> float | None:
        return None if math.isnan(told[name]) else told[name]

    fix = None
    if not math.isnan(told["fix_x"]):
        fix = Fix(
            told["fix_x"],
            told["fix_y"],
            told["fix_deviation"],
            Source.CORRECTED_SATELLITES,
            known("fix_heading"),
            told["fix_heading_deviation"],
            known("fix_stamp"),
            told["fix_stamp_deviation"],
            known("fix_speed"),
            told["fix_course"],
            told["fix_speed_deviation"],
        )
    beacons: tuple[Range, ...] = ()
    if not math.isnan(told["beacon_x"]):
        names = ("beacon_x", "beacon_y", "beacon_distance", "beacon_deviation")
        beacons = (Range(*(told[name] for name in names)),)
    ahead = known("ahead")
    seen = None
    if echoes is not None:
        table = np.array([row for row in echoes if row[3] >= 0.0]).reshape(-1, 4)
        seen = Echoes(table[:, 0], table[:, 1], table[:, 2], table[:, 3].astype(np.uint8))
    return Turn(
        Readings(
            told["time"],
            told["wheel_speed"],
            told["yaw_rate"],
            told["steering"],
            None if ahead is None else (ahead, told["left"]),
            fix,
            seen,
            beacons=beacons,
        ),
        Control(told["driver_steering"], told["driver_throttle"], told["driver_brake"]),
        GivenOrders(told["speed_cap"], told["thrust_scale"]),
    )
