"""The ids under which Gymnasium knows our environments; importing this costs next to nothing."""

import gymnasium

IDS = {"Kart/TimeTrial-v0": "time_trial", "Kart/Race-v0": "race"}


def register() -> None:
    """Make the ids known to Gymnasium, once."""
    for name, function in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=f"race_server.env.single:{function}",
                vector_entry_point=f"race_server.env.vector:{function}_vector",
            )
