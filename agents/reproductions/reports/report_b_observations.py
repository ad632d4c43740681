"""Report of the 1/10 race, 2023, table 5.2: what networks do on the training track with cars."""

from race_agents.reproductions.plan import Column, Exam, Reproduction, TrainingScale, Twist, Variant
from race_agents.reproductions.report_b import ASSUMPTIONS, GROWING_CRASH, OWN, STEPS_OF_2
from race_agents.training.settings import Tracks

_LIDAR = 'observation=["lidar"]'
_GAMMA, _LAMBDA = "algorithm.options.gamma=0.95", "algorithm.options.gae_lambda=0.90"
_ENTROPY = "algorithm.options.ent_coef=0.02"


def _old(name: str, remark: str, *changes: str, twist: Twist = OWN) -> Variant:
    return Variant(f"lidar alone, {name}", (_LIDAR, *changes), twist, (remark,))


def _new(
    name: str, remark: str, *changes: str, twist: Twist = OWN, steps_share: float = 1.0
) -> Variant:
    return Variant(f"all, {name}", changes, twist, (remark,), steps_share=steps_share)


REPRODUCTION = Reproduction(
    title="What networks see, and what they do on the training track",
    source="Report of the 1/10 race, table 5.2: remarks after training, three other cars on track",
    preset="report-b",
    rows=(
        _old("gamma 0.95", "near the borders in hard bends; seldom into cars", _GAMMA),
        _old(
            "growing crash", "slow on straights; avoids obstacles rather well", twist=GROWING_CRASH
        ),
        _old("lambda 0.90", "too near the border; slow on straights; passed a car", _LAMBDA),
        _old("entropy 0.02", "at times into obstacles; a whole lap; too near borders", _ENTROPY),
        _old(
            "value weight 2",
            "passed a car; a whole lap; too near borders",
            "algorithm.options.vf_coef=2.0",
        ),
        _old(
            "gamma 0.95, lambda 0.90",
            "rather fast on straights; less near borders; no whole lap",
            _GAMMA,
            _LAMBDA,
        ),
        _new("base", "avoids obstacles; at times into cars; passes even on straights"),
        _new(
            "growing crash",
            "several laps without a crash; avoids and passes cars; slow in bends",
            twist=GROWING_CRASH,
        ),
        _new("half the steps", "no difference to be noticed", steps_share=0.5),
        _new("lambda 0.90", "somewhat erratic; at times does not turn", _LAMBDA),
        _new("entropy 0.02", "several laps without a crash; somewhat slower", _ENTROPY),
        _new(
            "entropy 0.02, steps of 2°",
            "a whole lap; slow in bends; lively on straights",
            _ENTROPY,
            twist=STEPS_OF_2,
        ),
    ),
    exam=Exam(Tracks(set="train-2023"), alone=False, random_start=True),
    full=TrainingScale(steps=1_000_000, seeds=3, exam_s=180.0),
    quick=TrainingScale(steps=10_240, seeds=1, exam_s=60.0),
    their_heads=("remark",),
    columns=(
        Column("reward", "reward of a decision"),
        Column("speed", "speed, m/s"),
        Column("nearest", "nearest, m"),
        Column("crashes_per_minute", "crashes/min", 1),
        Column("places_per_minute", "places/min", 1),
        Column("laps", "laps", 1),
    ),
    plotted=Column("crashes_per_minute", "crashes a minute"),
    better="lower",
    assumptions=(
        *ASSUMPTIONS,
        "The report says in words what was seen and measures nothing here. Ours are figures of "
        "what its words speak of: speed, distance from what is nearest, crashes, places, laps.",
        "Its old rows have a network that sees the lidar alone, the new ones also the scan before, "
        "speed and steering. It has no row that differs in the observation alone; the growing "
        "crash, lambda 0.90 and entropy 0.02 come nearest.",
        "A crash that costs 300 and the number of crashes so far is counted over a whole training.",
    ),
)
