"""Residual actions: what a policy advises a scripted driver."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from race_server.core.observation import Layout
from race_server.core.state import Float32s, Floats, Record

# What an action of 1 advises: widths further left, and a share of the speed to add. The driver
# itself goes aside to pass, and to a box: with four widths a policy touched three times as many
# walls on covapsy-base as with none at all. Where no bend forbids it a boost carries a kart much
# further beyond the speeds of the line.
ASIDE_WIDTHS = 1.0
FASTER_SHARE = 0.12
DASH_SHARE = 0.5
# No kart farther away than this [own lengths] is a reason to leave the line or its speeds.
NEAR_LENGTHS = 10.0
# Parts that tell where others are: (x, y) in the kart's frame, or along and across the line.
OTHERS = (("karts_x", "karts_y"), ("karts_along", "karts_across"))


def advice_of(actions: Float32s, width: float) -> Floats:
    """Return what residual actions (..., 6) advise, see ASIDE in `race_server.core.kernel_driver`.

    width: of the vehicle [m]. Of the last three numbers only what is above zero counts.
    """
    scales = np.array([ASIDE_WIDTHS * width, FASTER_SHARE, 1.0, DASH_SHARE, 1.0, 1.0])
    lows = np.array([-1.0, -1.0, -1.0, 0.0, 0.0, 0.0])
    return np.clip(actions.astype(np.float64), lows, 1.0) * scales


class Adviser:
    """Advice to drivers whose policy may see others.

    One that sees them leaves lane and speed to the driver while none is near: the driver holds
    courses that no policy learned on, and is faster there.
    """

    def __init__(self, layout: Layout, parts: Collection[str], vehicle: Record) -> None:
        """Find the others in observations. parts: what the policy sees of the layout."""
        self._width = float(vehicle.width)
        self._near = NEAR_LENGTHS * float(vehicle.length)
        self._others = [
            (layout.slices[x], layout.slices[y]) for x, y in OTHERS if {x, y} <= set(parts)
        ]

    def advice(self, actions: Float32s, observations: NDArray[np.floating]) -> Floats:
        """Return what actions (..., 6) advise where observations (..., size) are seen."""
        advice = advice_of(actions, self._width)
        for x, y in self._others:
            away = np.hypot(observations[..., x], observations[..., y]).min(axis=-1)
            advice[..., :2] *= (away < self._near)[..., None]
        return advice
