"""Reality gaps by name: what a trial lets go wrong between the driver and the car."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from race_server.core.clock import TICK_S
from race_server.envs.reality_gap import MOST_DELAY, RealityGap
from race_server.errors import ScenarioError
from race_server.scenario.sensors import Lidar

DECISION_TICKS = 3
DECISION_S = DECISION_TICKS * TICK_S
CUSTOM = "custom"


@dataclass(frozen=True)
class Gap:
    """One setting. Each run draws from the ranges under its seed; a point means fixed."""

    name: str
    reality: RealityGap = field(default_factory=RealityGap)
    noise: float = Lidar().noise  # [m] standard deviation of a lidar range
    dropouts: float = 0.0  # share of lidar rays that come back as 0

    def lidar(self) -> Lidar:
        """Return the lidar with its faults."""
        return replace(Lidar(), noise=self.noise, dropout=self.dropouts)

    def words(self) -> str:
        """Return what this setting changes, for a person."""
        nominal, parts, reality = Gap(""), [], self.reality
        if self.noise != nominal.noise:
            parts.append(f"lidar noise {100.0 * self.noise:g} cm")
        if self.dropouts:
            parts.append(f"{100.0 * self.dropouts:g} % of the lidar rays drop out")
        if delay := reality.action_delay[1]:
            parts.append(f"answers act {1000.0 * delay * DECISION_S:.0f} ms late")
        if reality.speed_coefficient != nominal.reality.speed_coefficient:
            parts.append(f"motor and top speed {_range_words(reality.speed_coefficient)}")
        if lag := reality.actuator_lag[1]:
            parts.append(f"pedals and wheel follow with {1000.0 * lag:g} ms")
        if play := reality.steering_play[1]:
            parts.append(f"{100.0 * play:g} % play in the steering")
        if reality.grip != nominal.reality.grip:
            parts.append(f"grip {_range_words(reality.grip)}")
        return ", ".join(parts) or "the nominal car, lidar noise 1 cm"


def _range_words(factors: tuple[float, float]) -> str:
    low, high = (100.0 * factor for factor in factors)
    return f"{low:g} to {high:g} %"


NONE = Gap("none")
# The faults that the 1/10 race's report names: lidar noise and drop-outs, an unregulated motor
# whose speed varies with the battery, play in the steering. Their sizes are our choice: three
# times the simulator's noise, every twentieth ray, one decision of delay, ±10 % of speed.
_ALL = Gap(
    "all",
    RealityGap(
        action_delay=(1.0, 1.0),
        speed_coefficient=(0.9, 1.1),
        actuator_lag=(0.05, 0.05),
        steering_play=(0.05, 0.05),
        grip=(0.9, 1.1),
    ),
    noise=0.03,
    dropouts=0.05,
)
# The names of single factors of the reality gap.
_FACTORS = {
    "delay": "action_delay",
    "battery": "speed_coefficient",
    "lag": "actuator_lag",
    "play": "steering_play",
    "grip": "grip",
}


def _only(name: str, factor: str) -> Gap:
    """Return a setting in which one factor alone is off, as far as in the setting `all`."""
    return Gap(name, replace(RealityGap(), **{factor: getattr(_ALL.reality, factor)}))


GAPS = {
    gap.name: gap
    for gap in (
        NONE,
        Gap("noise", noise=_ALL.noise),
        Gap("dropouts", dropouts=_ALL.dropouts),
        *(_only(name, factor) for name, factor in _FACTORS.items()),
        _ALL,
    )
}


def gaps_named(names: Sequence[str]) -> list[Gap]:
    """Return the settings of these names.

    Raises:
        ScenarioError: there is none of a name.
    """
    for name in names:
        if name not in GAPS:
            raise ScenarioError(
                f"reality gap {name!r} is unknown; choose from {', '.join(GAPS)}, or give "
                "--noise, --dropouts, --delay-ms"
            )
    return [GAPS[name] for name in names]


def custom_gap(noise: float | None, dropouts: float | None, delay_ms: float | None) -> Gap | None:
    """Return the setting of single figures, None without any.

    noise: [m]; dropouts: share of rays; delay_ms: a whole number of decisions.

    Raises:
        ScenarioError: a figure is out of range.
    """
    if noise is None and dropouts is None and delay_ms is None:
        return None
    gap = Gap(CUSTOM)
    if noise is not None:
        if not 0.0 <= noise <= 1.0:
            raise ScenarioError(f"lidar noise {noise:g} m: choose 0 to 1 m")
        gap = replace(gap, noise=noise)
    if dropouts is not None:
        if not 0.0 <= dropouts <= 1.0:
            raise ScenarioError(f"drop-outs {dropouts:g}: give a share of the rays from 0 to 1")
        gap = replace(gap, dropouts=dropouts)
    if delay_ms is not None:
        delay = float(_decisions(delay_ms))
        gap = replace(gap, reality=RealityGap(action_delay=(delay, delay)))
    return gap


def _decisions(delay_ms: float) -> int:
    step_ms = 1000.0 * DECISION_S
    delay = round(delay_ms / step_ms) if math.isfinite(delay_ms) else -1
    if abs(delay * step_ms - delay_ms) > 0.5 or not 0 <= delay <= MOST_DELAY:
        raise ScenarioError(
            f"delay {delay_ms:g} ms: drivers decide every {step_ms:.0f} ms, choose a multiple of "
            f"that up to {MOST_DELAY * step_ms:.0f} ms"
        )
    return delay
