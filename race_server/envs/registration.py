"""The ids under which Gymnasium and PettingZoo know our environments.

They refer to functions by name, so that importing this costs next to nothing.
"""

import gymnasium

RACE = "Kart/Race-v0"
TIME_TRIAL = "Kart/TimeTrial-v0"
PARK, PARK_GOAL, LOT = "Kart/Park-v0", "Kart/ParkGoal-v0", "Kart/Lot-v0"
PARK_TRAILER, PARK_TRAILER_GOAL = "Kart/ParkTrailer-v0", "Kart/ParkTrailerGoal-v0"
# Spaces, rewards and infos of highway-env's parking-v0 and racetrack-v0.
PARK_COMPATIBLE, RACETRACK_COMPATIBLE = "Kart/ParkCompatible-v0", "Kart/RacetrackCompatible-v0"
# What makes one environment, and what makes a vector of them, by id.
MAKERS = {
    TIME_TRIAL: ("single:time_trial", "vector:time_trial_vector"),
    RACE: ("single:race", "vector:race_vector"),
    PARK: ("parking.single:park", "parking.single:park_vector"),
    PARK_GOAL: ("parking.single:park_goal", None),
    PARK_TRAILER: ("parking.single:park_trailer", "parking.single:park_trailer_vector"),
    PARK_TRAILER_GOAL: ("parking.single:park_trailer_goal", None),
    PARK_COMPATIBLE: (
        "compatible.parking:ParkCompatible",
        "compatible.parking:park_compatible_vector",
    ),
    RACETRACK_COMPATIBLE: (
        "compatible.racetrack:RacetrackCompatible",
        "compatible.racetrack:racetrack_compatible_vector",
    ),
}


def register_gymnasium() -> None:
    """Make the ids known to Gymnasium, once."""
    for name, (one, many) in MAKERS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=f"race_server.envs.{one}",
                vector_entry_point=f"race_server.envs.{many}" if many else None,
            )


def register_pettingzoo() -> None:
    """Make races and car parks known to PettingZoo, parallel and turn by turn."""
    try:
        from pettingzoo.env_registry.registration import register
    except ModuleNotFoundError:
        return  # before 1.27, to which some libraries pin it, there is no registry

    register("parallel", RACE, entry_point="race_server.envs.parallel:parallel_env")
    register("aec", RACE, entry_point="race_server.envs.parallel:env")
    register("parallel", LOT, entry_point="race_server.envs.parallel:parallel_lot")
    register("aec", LOT, entry_point="race_server.envs.parallel:lot")
