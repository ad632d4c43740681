"""The cockpit of one kart, as those that drive many karts take it."""

import numpy as np

from race_server.core.kernel_driver import Cockpit, Cockpits
from race_server.core.vehicle_presets import TT02
from race_server.core.vehicles import vehicle_record


def alone(cockpit: Cockpit) -> Cockpits:
    """Return the cockpits of a batch in which one `tt02` drives; its arrays are shared."""
    return Cockpits(
        np.zeros((1, 2), np.int64),
        cockpit.observation[None, None],
        cockpit.offsets,
        vehicle_record(TT02).reshape(1, 1),
        cockpit.setup,
        cockpit.item_uses,
        cockpit.memory[None, None],
        cockpit.control[None, None],
    )
