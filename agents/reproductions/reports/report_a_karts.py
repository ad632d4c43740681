"""Report on automatic parking, "2 + 2": the yard with two more karts that park."""

from race_agents.reproductions.plan import ParkingExam, Reproduction, TrainingScale, Variant
from race_agents.reproductions.report_a import (
    ASSUMPTIONS,
    BUMPS_WORD,
    CLONING,
    CURIOSITY,
    GAIL,
    HALVES,
    HALVES_WORD,
    KARTS,
    ONE_WAY,
    PARKED,
    RATE_WORD,
    SIX_STAGES,
    SOURCE,
    STEPS,
    THEIR_HEADS,
    columns,
)

_AIDS = ("gail", "cloning")

REPRODUCTION = Reproduction(
    title="Parking across a yard among two more karts",
    source=f"{SOURCE}, scenario 2 + 2: about 500 episodes and one run each, so ± 4 points",
    preset="report-a",
    changes=(*KARTS, *CURIOSITY, *GAIL, *CLONING, *HALVES),
    rows=(
        Variant(
            "PPO with three aids",
            theirs=("73.7", "–", "98", "mostly collisions with a kart"),
            their_number=73.7,
            imitates=_AIDS,
        ),
        Variant(
            "PPO with three aids, six stages",
            (SIX_STAGES,),
            theirs=("75.8", "–", "98", "took longest"),
            their_number=75.8,
            imitates=_AIDS,
        ),
        Variant(
            "POCA with three aids",
            ("algorithm.name=poca", "network.products=none"),
            theirs=("77.3", "–", "98", "about 5 h 30"),
            their_number=77.3,
            imitates=_AIDS,
        ),
    ),
    exam=ParkingExam(),
    full=TrainingScale(steps=STEPS, seeds=3, starts=1000, demonstrated=10_000),
    quick=TrainingScale(steps=24_576, seeds=1, starts=100, demonstrated=600),
    their_heads=THEIR_HEADS,
    columns=columns("late", "wall", "block", "vehicle", "person"),
    plotted=PARKED,
    assumptions=(
        *ASSUMPTIONS,
        RATE_WORD,
        HALVES_WORD,
        ONE_WAY,
        BUMPS_WORD,
        "Its third row is POCA with three aids and no stages. With one kart that learns it is PPO "
        "with another critic: the baseline that leaves its action out knows what the critic knows. "
        "It multiplies float32.",
        "The two other karts drive the policy `parking-2` of this program, which learned alone in "
        "this yard, each to a slot that no other has.",
        "98 % aligned is told of 386 of 393 in one of its rows, not of which.",
        "Each of its stages had a demonstration; here all have the same 10 000 decisions of the "
        "driver `valet`, from starts as far as the last stage has them.",
        "Strengths of curiosity and GAIL are those of `report-a-curriculum`.",
    ),
)
