"""Report on an articulated vehicle: three algorithms with the same heuristic."""

from race_agents.reproductions.plan import Variant
from race_agents.reproductions.report_c import SAC_ASSUMPTION, table_of

# It takes none of SAC's options; its rollouts are of 64 times 64 decisions.
_OPTIONS = "algorithm.options={n_steps = 64, batch_size = 512, n_epochs = 4, gamma = 0.99}"
_PPO = ("algorithm.name=ppo", _OPTIONS, "network.log_std=0.0")

REPRODUCTION = table_of(
    "A lorry learns to park: SAC, TD3 and PPO",
    Variant("SAC", theirs=("the only one tried",)),
    Variant("TD3", ("algorithm.name=td3",), theirs=("asked for",)),
    Variant("PPO", _PPO, theirs=("asked for",), quick_changes=(_OPTIONS,)),
    changes=("parking.heuristic=hybrid",),
    finding="SAC; the others are asked for",
    base="SAC",
    assumptions=(
        SAC_ASSUMPTION,
        "All three have the same network, learning rate, discount and batch. PPO takes 4 passes "
        "over each 4096 decisions: one update for 128 of them.",
    ),
)
