"""A driver that has learned: `learned:NAME` drives the policy of a file or of a training run."""

from collections.abc import Callable
from typing import Any

import numpy as np

from race_agents.planning.charting import Charting
from race_agents.planning.evasion import SEES as EVADER_SEES
from race_agents.planning.evasion import evade_all
from race_agents.planning.line_policy import foresee_for_all, remember_for_all
from race_agents.planning.line_view import layout_with_scan, with_scan
from race_agents.planning.scan_policy import limit_all
from race_agents.policies.metadata import PolicyMetadata, preset_for
from race_agents.policies.places import picked, places_in
from race_agents.policies.registry import policy_path
from race_agents.policies.session import Policy
from race_server.core import codes
from race_server.core.clock import ticks_of
from race_server.core.driver import Briefing, driver_named
from race_server.core.kernel_driver import (
    ACTED,
    ASIDE,
    DECISION,
    FETCH,
    Cockpits,
    KernelDriver,
    cockpit_at,
    elapsed_s,
    item_uses_of,
    memory_size,
)
from race_server.core.kernels.jit import bind, kernel
from race_server.core.messages import Button, Control
from race_server.core.observation import PART_NUMBERS, PRESETS, Layout, Observation, offsets_of
from race_server.core.parking_order import ParkingOrder
from race_server.core.rules.items import items
from race_server.core.state import Float32s, Floats, Ints
from race_server.core.vehicles import vehicle_record
from race_server.envs.actions import (
    MEMORY,
    Driven,
    action_kind,
    discrete_table,
    read_action,
)
from race_server.envs.advice import OTHERS, Adviser
from race_server.errors import DriverError

# Read besides what the policy sees; every observation of a live race has them.
SPEED = PART_NUMBERS["speed"]
LIGHTS = PART_NUMBERS["lights"]
FINISHED = PART_NUMBERS["finished"]
RESCUE_OFFERED = PART_NUMBERS["rescue_offered"]
# A policy that drives by the speeds of the line is helped as the drivers on the line are, one whose
# file has a limit by the scan as `follow_gap` is, and one that evades by what is around it; for
# that more is looked at than it sees.
LINE_SPEED, LINE_SEES, SCAN_SEES = "line_speed_ahead", "line", "lidar"
# Parts that tell a policy where its slot is.
SLOT_PARTS = frozenset(name for name in PART_NUMBERS if "goal_" in name or "slot_" in name)


class Learned:
    """Drives a policy that was learned: `learned:NAME`, a run, a shipped policy or an .onnx file.

    What it answers means the same as in training, because the same function reads it. Where
    decisions are due more often than it learned to decide, it keeps to its own pace.
    """

    keeps_to_vehicles = True  # it drives no other ones, even where that is asked for

    def __init__(self, name: str) -> None:
        """Load a policy.

        Raises:
            DriverError: there is none of that name, or its file is foreign or damaged.
        """
        self.policy = Policy(policy_path(name))
        nature = self.policy.metadata
        self._base = driver_named(nature.base) if nature.base else None
        self._is_helped = self._base is None and LINE_SPEED in nature.parts
        more: tuple[str, ...] = PRESETS[LINE_SEES] if self._is_helped else ()
        if nature.scan_limit or nature.charts:
            more = PRESETS[SCAN_SEES]
        if nature.evades:
            more = EVADER_SEES
        if self._base is not None:
            more = PRESETS[self._base.preset]
        self.preset = preset_for(nature, self.policy.name, more)
        self.vehicles = nature.vehicles
        self._kind = action_kind(self.policy.metadata.action)
        self._table = discrete_table()

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race.

        Raises:
            DriverError: the policy learned with another vehicle or at another pace.
        """
        pace = _pace_of(self.policy.metadata, briefing, self.policy.name)
        self._pace_ticks = ticks_of(self.policy.metadata.decision_s) if pace > 1 else 1
        self._briefing = briefing
        self._seats: dict[str, Seat] = {}
        self._seat: Seat | None = None
        self._charting = Charting(briefing) if self.policy.metadata.charts else None
        self._places: Ints | None = None
        self._control, self._period = Control(), -1
        vehicle = briefing.vehicle
        if self.policy.metadata.evades and vehicle.trailers:
            raise DriverError(
                f"{self.policy.name} evades, which is reckoned for one body, and {vehicle.name} "
                "draws a trailer; export it without"
            )
        if self._base is not None:
            self._base.reset(briefing)

    def park(self, order: ParkingOrder) -> None:
        """Drive to a slot, which the policy sees: it needs nothing else of the order.

        Raises:
            DriverError: it learned without a slot.
        """
        if SLOT_PARTS.isdisjoint(self.policy.metadata.parts):
            raise DriverError(
                f"{self.policy.name} cannot park: it learned without seeing a slot; choose a "
                "policy that learned to park"
            )

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        seen = observation if self._charting is None else self._seen(self._charting, observation)
        # At the ticks of training, whenever it begins: those at which sensors have just scanned.
        period = observation.tick // self._pace_ticks
        if period == self._period:
            return self._control
        self._period = period
        self._control = self._decide(seen)
        return self._control

    def _seen(self, charting: Charting, observation: Observation) -> Observation:
        """Return what is seen, with the line once the course is charted.

        Without it where others are near and the policy sees none beside the line.
        """
        charted = charting.look(observation)
        sees_others = any(x in self.policy.metadata.parts for x, _ in OTHERS)
        if charted is None or (charting.meets_others and not sees_others):
            return observation
        return with_scan(charted, observation)

    def _decide(self, observation: Observation) -> Control:
        """Return what to do until the policy's next decision."""
        if isinstance(self._base, KernelDriver):
            return self._act_by_advice(self._base, observation)
        if not self._seats:
            self._prepare(observation.layout)
        seat = self._seats[observation.layout.preset]
        if seat is not self._seat:
            seat.forget()
            self._seat = seat
        return seat.decide(observation)

    def _act_by_advice(self, base: KernelDriver, observation: Observation) -> Control:
        """Return what the driver does that the policy advises."""
        told, nature = self._briefing, self.policy.metadata
        if self._places is None:
            setup = np.array([told.lidar_field, told.lidar_reach, told.decision_s])
            self._places = places_in(observation.layout, nature, setup, self.policy.name)
            vehicle = vehicle_record(told.vehicle)[0]
            self._adviser = Adviser(observation.layout, nature.parts, vehicle)
        action = self.policy.decide(observation.values[None, self._places])[0]
        advice = self._adviser.advice(action, observation.values)
        base.take_advice(observation, advice.tolist())
        return base.act(observation)

    def _prepare(self, layout: Layout) -> None:
        """Take the seats from which it will decide; in the race there is no time to compile."""
        layouts = [layout]
        if self._charting is not None:
            layouts.append(layout_with_scan(layout))
        self._seats = {one.preset: Seat(self, self._briefing, one) for one in layouts}

    def driving(self, cockpits: Cockpits, layout: Layout) -> Callable[[], None]:
        """Return what drives many karts, with one pass of the network for all of them.

        layout: of the observations.

        Raises:
            DriverError: the karts have another lidar than the policy learned with.
        """
        places = places_in(layout, self.policy.metadata, cockpits.setup, self.policy.name)
        worlds, numbers = cockpits.seats[:, 0], cockpits.seats[:, 1]
        views, memory = cockpits.observations, cockpits.memory
        if self._base is not None:
            base: Any = type(self._base)
            uses = item_uses_of(tuple(item.name for item in items()))
            follow = bind(base.decide_all, cockpits._replace(item_uses=uses))
            adviser = Adviser(layout, self.policy.metadata.parts, cockpits.vehicles[0, 0])

            def advise() -> None:
                seen = views[worlds, numbers]
                actions = self.policy.decide(picked(seen, places))
                memory[worlds, numbers, ASIDE : FETCH + 1] = adviser.advice(actions, seen)
                follow()

            return advise

        before, behind = self._help(cockpits, layout)

        def drive() -> None:
            before()
            actions = self.policy.decide(picked(views[worlds, numbers], places))
            command_all(self._kind, cockpits, actions, self._table)
            behind()

        return drive

    def _help(
        self, cockpits: Cockpits, layout: Layout
    ) -> tuple[Callable[[], None], Callable[[], None]]:
        """Return what is done before the network answers, and behind it."""
        nature = self.policy.metadata
        if nature.evades:
            return _nothing, bind(evade_all, cockpits)
        if self._is_helped and LINE_SPEED in layout.slices:
            return bind(foresee_for_all, cockpits), bind(remember_for_all, cockpits)
        if nature.scan_limit:
            return _nothing, bind(limit_all, cockpits, nature.scan_limit)
        return _nothing, _nothing


class Seat:
    """The seat of one kart: a batch of one."""

    def __init__(self, driver: Learned, told: Briefing, layout: Layout) -> None:
        """Take the seat of a driver that is told its race. layout: of its observations.

        Raises:
            DriverError: the kart has another lidar than the policy learned with.
        """
        offsets, decision_s = offsets_of(layout), driver.policy.metadata.decision_s
        self.cockpits = Cockpits(
            np.zeros((1, 2), np.int64),
            np.zeros((1, 1, layout.size)),
            offsets,
            vehicle_record(told.vehicle).reshape(1, 1),
            np.array([told.lidar_field, told.lidar_reach, decision_s]),
            item_uses_of(told.items),
            np.zeros((1, 1, memory_size(int(offsets[-1])))),
            np.zeros((1, 1, 4)),
        )
        self._drive = driver.driving(self.cockpits, layout)
        self._decision_s, self._tick = decision_s, -1  # the tick of the last decision

    def forget(self) -> None:
        """Forget the decisions so far, the last of which may be long ago."""
        self.cockpits.memory[...] = 0.0
        self._tick = -1

    def decide(self, observation: Observation) -> Control:
        """Return what to do until the next decision."""
        setup = self.cockpits.setup
        setup[DECISION] = elapsed_s(self._tick, observation.tick, self._decision_s)
        self._tick = observation.tick
        self.cockpits.observations[0, 0] = observation.values
        self._drive()
        steering, throttle, brake, buttons = self.cockpits.controls[0, 0].tolist()
        return Control(steering, throttle, brake, Button(int(buttons)))


def _nothing() -> None:
    """Do nothing."""


@kernel
def command_all(kind: int, cockpits: Cockpits, actions: Float32s, table: Floats) -> None:
    """Turn the actions (n, A) of many karts into controls, as training does.

    kind: of the actions; table: (N, 3) discrete actions. Before the lights go out and after
    the finish, which training does not know, a kart stands.
    """
    for row in range(len(cockpits.seats)):
        cockpit = cockpit_at(cockpits, row)
        observation, offsets = cockpit.observation, cockpit.offsets
        control, kept = cockpit.control, cockpit.memory[ACTED:]
        if observation[offsets[LIGHTS]] > 0.0 or observation[offsets[FINISHED]] > 0.0:
            control[0], control[1], control[2], control[3] = 0.0, 0.0, 1.0, 0.0
            kept[MEMORY] = 0.0
            continue
        kart = Driven(observation[offsets[SPEED]], int(kept[MEMORY]), 0)
        read_action(kind, actions[row], table, kart, cockpit.vehicle, kept, control)
        control[0] = min(max(control[0], -1.0), 1.0)
        control[1] = min(max(control[1], -1.0), 1.0)
        control[2] = min(max(control[2], 0.0), 1.0)
        kept[MEMORY] = control[3]
        if observation[offsets[RESCUE_OFFERED]] > 0.0:
            control[3] = float(int(control[3]) | codes.ACCEPT_RESCUE)


def _pace_of(nature: PolicyMetadata, briefing: Briefing, name: str) -> int:
    """Return how many decisions of a race fit into one of a policy.

    Raises:
        DriverError: it learned with another vehicle, or the decisions do not fit.
    """
    if briefing.vehicle.name not in nature.vehicles:
        raise DriverError(
            f"{name} learned to drive {' and '.join(nature.vehicles)}, not "
            f"{briefing.vehicle.name}; "
            "choose that vehicle or train another policy"
        )
    pace = nature.decision_s / briefing.decision_s
    if pace < 0.5 or abs(pace - round(pace)) > 1e-6:
        raise DriverError(
            f"{name} learned to decide every {nature.decision_s:g} s, not every "
            f"{briefing.decision_s:g} s; train it at that pace"
        )
    return round(pace)
