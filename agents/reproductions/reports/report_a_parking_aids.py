"""Report on automatic parking, figures 30 to 34: what helps learning, in the simple scenario."""

from race_agents.reproductions.plan import (
    Column,
    ParkingExam,
    Reproduction,
    TrainingScale,
    Twist,
    Variant,
)
from race_agents.reproductions.report_a import ASSUMPTIONS, PARKED, SOURCE, columns


def _buffer(agents: int, horizon: int) -> tuple[str, ...]:
    return (f"worlds={agents}", f"algorithm.options.n_steps={horizon}")


def _network(width: int, depth: int) -> tuple[str, ...]:
    return (f"network.layers={[width] * depth}",)


_DEFAULTS = (
    *_buffer(2, 50),
    *_network(128, 2),
    "algorithm.learning_rate=3e-4",
    "algorithm.options.batch_size=10",
    "algorithm.options.gae_lambda=0.99",
    "algorithm.options.ent_coef=5e-4",
)
# It takes no options of PPO; its buffer is of one million decisions.
_SAC = (
    "algorithm.name=sac",
    "worlds=8",
    "algorithm.options={batch_size = 512, gamma = 0.99, gradient_steps = 1}",
)

REPRODUCTION = Reproduction(
    title="Aids to learning to park: agents, penalties, normalisation, network, buffer, algorithm",
    source=f"{SOURCE}, figures 30 to 34: curves without numbers, one slot 5 m ahead",
    preset="report-a",
    changes=('parking.lots=["face-to-face"]', "algorithm.last_learning_rate=0.0"),
    base="final",
    rows=(
        Variant("final", theirs=("about 5 times as fast as the defaults",)),
        Variant(
            "defaults",
            _DEFAULTS,
            Twist(scaling="none"),
            ("about 5 times slower",),
            steps_share=0.5,
        ),
        Variant("8 agents", _buffer(8, 512), theirs=("4 h 30, on a slower computer",)),
        Variant("32 agents", _buffer(32, 128), theirs=("1 h 50",)),
        Variant("256 agents", _buffer(256, 16), theirs=("1 h 30",)),
        Variant("crooked costs 0.1", ("reward.misparked=-0.1",), theirs=("ends worse",)),
        Variant("no penalty per step", ("reward.time=0.0",), theirs=("as good",)),
        Variant("no normalisation", twist=Twist(scaling="none"), theirs=("slower",)),
        Variant("width 128", _network(128, 3), theirs=("slower than 512, a step is faster",)),
        Variant("width 256", _network(256, 3), theirs=("between 128 and 512",)),
        Variant("depth 1", _network(512, 1), theirs=("slower than 3, a step is faster",)),
        Variant("depth 2", _network(512, 2), theirs=("between 1 and 3",)),
        Variant(
            "large buffer",
            _buffer(128, 3200),
            theirs=("409600 instead of 4096: slower",),
            quick_changes=_buffer(128, 64),
        ),
        Variant("horizon 2048", _buffer(2, 2048), theirs=("slower; shorter is better",)),
        Variant("POCA", ("algorithm.name=poca",), theirs=("as good, fewer steps, slower",)),
        Variant("SAC", _SAC, theirs=("stopped after 1 h: too slow",), steps_share=0.1),
    ),
    exam=ParkingExam(),
    full=TrainingScale(steps=1_024_000, seeds=3, starts=1000),
    quick=TrainingScale(steps=16_384, seeds=1, starts=100),
    their_heads=("finding",),
    columns=(Column("learning_return", "parked while learning", 3), *columns("late", "wall")),
    plotted=PARKED,
    assumptions=(
        *ASSUMPTIONS,
        "The learning rate falls evenly to zero at the end of the training, the report's at 200 "
        "million steps.",
        "The reward is that of scenario 1, its second configuration.",
        "Parked while learning is the mean over the whole training of the share of the last "
        "hundred episodes that parked: higher the earlier it is learned.",
        "Agents at once, buffer and horizon: Stable-Baselines3 ties them together, as the buffer "
        "is agents times horizon. At a buffer of 4096 more agents mean a shorter horizon: 128 "
        "times 32, 8 times 512, 32 times 128, 256 times 16, and 2 times 2048 for the longest. The "
        "report's library cuts its buffer into horizons of any length; a buffer of 100 with a "
        "horizon of 64, its default, is 2 times 50 here.",
        "The large buffer is 409600 decisions, in a quick run 8192: half of what it has.",
        "The defaults learn half as many decisions as the others, SAC a tenth, with one update "
        "for 8 decisions: they take more processor time for each.",
        "With one kart that learns POCA is PPO with another critic, which has an attention over "
        "one. SAC with hindsight, which the report did not try, stands in `report-a-transfer`.",
    ),
)
