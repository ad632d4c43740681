"""The ids under which Gymnasium and PettingZoo know our environments.

They refer to functions by name, so that importing this costs next to nothing.
"""

import gymnasium

RACE = "Kart/Race-v0"
TIME_TRIAL = "Kart/TimeTrial-v0"


def register_gymnasium() -> None:
    """Make the ids known to Gymnasium, once."""
    for name, function in ((TIME_TRIAL, "time_trial"), (RACE, "race")):
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=f"race_server.envs.single:{function}",
                vector_entry_point=f"race_server.envs.vector:{function}_vector",
            )


def register_pettingzoo() -> None:
    """Make the race known to PettingZoo, as a parallel and as a turn-based environment."""
    from pettingzoo.env_registry.registration import register

    register("parallel", RACE, entry_point="race_server.envs.parallel:parallel_env")
    register("aec", RACE, entry_point="race_server.envs.parallel:env")
