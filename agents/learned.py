"""A driver that has learned: `learned:NAME` drives the policy of a file or of a training run."""

import numpy as np

from agents.policies.nature import Nature, preset_for
from agents.policies.session import Policy
from agents.policies.shelf import policy_path
from race_server.driver import Briefing
from race_server.env.actions import MEMORY, action_kind, discrete_table, read_action
from race_server.errors import DriverError
from race_server.messages import Button, Control
from race_server.observe import Layout, Observation
from race_server.params import vehicle_record
from race_server.state import KART, Ints

# A field of view may differ by so much [rad] from the one that was learned.
FIELD_TOLERANCE = 1e-3
STAND = Control(0.0, 0.0, 1.0, Button.NONE)


class Learned:
    """Drives a policy that was learned: `learned:NAME`, a run, a shipped policy or an .onnx file.

    What it answers means the same as in training, because the same function reads it.
    """

    def __init__(self, name: str) -> None:
        """Load a policy.

        Raises:
            DriverError: there is none of that name, or its file is foreign or damaged.
        """
        self.policy = Policy(policy_path(name))
        self.preset = preset_for(self.policy.nature, self.policy.name)
        self._kind = action_kind(self.policy.nature.action)
        self._table = discrete_table()

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race.

        Raises:
            DriverError: the policy learned with another vehicle or at another pace.
        """
        _check_briefing(self.policy.nature, briefing, self.policy.name)
        self._field = briefing.lidar_field
        self._vehicle = vehicle_record(briefing.vehicle)[0]
        self._kart = np.zeros(1, KART)[0]
        self._memory = np.zeros(MEMORY)
        self._control = np.zeros(4)
        self._places: Ints | None = None

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        if self._places is None:
            self._places = places_in(
                observation.layout, self.policy.nature, self._field, self.policy.name
            )
        if _has_to_stand(observation):
            return STAND
        action = self.policy.decide(observation.values[None, self._places])[0]
        kart, control = self._kart, self._control
        kart.speed = observation.scalar("speed")
        read_action(self._kind, action, self._table, kart, self._vehicle, self._memory, control)
        kart.buttons_before = int(control[3])
        buttons = Button(int(control[3]))
        if _is_on(observation, "rescue_offered"):
            buttons |= Button.ACCEPT_RESCUE
        steering, throttle, brake = np.clip(control[:3], (-1.0, -1.0, 0.0), 1.0).tolist()
        return Control(steering, throttle, brake, buttons)


def _is_on(observation: Observation, part: str) -> bool:
    return part in observation.layout.slices and observation.scalar(part) > 0.0


def _has_to_stand(observation: Observation) -> bool:
    """Return whether the lights are on or the race is over: training knows neither."""
    return _is_on(observation, "lights") or _is_on(observation, "finished")


def _check_briefing(nature: Nature, briefing: Briefing, name: str) -> None:
    if briefing.vehicle.name != nature.vehicle:
        raise DriverError(
            f"{name} learned to drive {nature.vehicle!r}, not {briefing.vehicle.name!r}; "
            "choose that vehicle or train another policy"
        )
    if abs(briefing.decision_s - nature.decision_s) > 1e-6:
        raise DriverError(
            f"{name} learned to decide every {nature.decision_s:g} s, not every "
            f"{briefing.decision_s:g} s; train it at that pace"
        )


def places_in(layout: Layout, nature: Nature, field: float, name: str) -> Ints:
    """Return where each number that a policy sees lies in a larger observation, shape (size,).

    A policy that learned with fewer lidar rays in the same field takes every so many of them.

    Raises:
        DriverError: a part is missing, or has another size.
    """
    places: list[int] = []
    for part, size in zip(nature.parts, nature.sizes, strict=True):
        if part not in layout.slices:
            raise DriverError(f"{name} wants to see {part!r}; the race shows {layout.preset!r}")
        there = layout.slices[part]
        offered = there.stop - there.start
        step = 1
        if part in {"lidar", "lidar_before"}:
            if abs(field - nature.lidar_field) > FIELD_TOLERANCE:
                raise DriverError(
                    f"{name} learned with a lidar of {np.degrees(nature.lidar_field):.0f}°, "
                    f"this one sees {np.degrees(field):.0f}°; train it with this lidar"
                )
            step = max((offered - 1) // max(size - 1, 1), 1)
        if offered != (size - 1) * step + 1:
            raise DriverError(
                f"{name} learned with {size} numbers of {part!r}, the race shows {offered}; "
                "train it with this many"
            )
        places += range(there.start, there.stop, step)
    return np.array(places, np.int64)
