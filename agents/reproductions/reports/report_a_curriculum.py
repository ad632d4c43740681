"""Report on automatic parking: stages, curiosity, imitation, in both scenarios."""

from race_agents.reproductions.plan import ParkingExam, Reproduction, TrainingScale, Variant
from race_agents.reproductions.report_a import (
    ASSUMPTIONS,
    BUMPS_WORD,
    CLONING,
    CURIOSITY,
    GAIL,
    HALVES,
    HALVES_WORD,
    ONE_WAY,
    PARKED,
    RATE_WORD,
    SCENARIO_2,
    SIX_STAGES,
    SOURCE,
    STEPS,
    columns,
    stages,
)

ZONE_STAGES = stages(((2.0, 6.0), (2.0, 12.0), (2.0, 20.0)), 0.5)

REPRODUCTION = Reproduction(
    title="Aids to exploration: stages, curiosity, imitation by GAIL, cloning",
    source=f"{SOURCE}: time until it converged, of one run each",
    preset="report-a",
    changes=('parking.lots=["zone-30-east"]', *HALVES),
    rows=(
        Variant("scenario 1, at once", theirs=("98.0", "1 h", "")),
        Variant(
            "scenario 1, stages",
            (ZONE_STAGES,),
            theirs=("–", "–", "converges earlier"),
        ),
        Variant("scenario 2, at once", SCENARIO_2, theirs=("–", "never", "does not learn")),
        Variant(
            "scenario 2, stages",
            (*SCENARIO_2, SIX_STAGES),
            theirs=("90", "about 1 day", "97 % of the parked are aligned"),
            their_number=90.0,
        ),
        Variant("scenario 2, curiosity", (*SCENARIO_2, *CURIOSITY), theirs=("–", "11 h", "")),
        Variant(
            "scenario 2, curiosity and GAIL",
            (*SCENARIO_2, *CURIOSITY, *GAIL),
            theirs=("–", "6 h", ""),
            imitates=("gail",),
        ),
        Variant(
            "scenario 2, curiosity, GAIL and cloning",
            (*SCENARIO_2, *CURIOSITY, *GAIL, *CLONING),
            theirs=("–", "4 h", ""),
            imitates=("gail", "cloning"),
        ),
    ),
    exam=ParkingExam(),
    full=TrainingScale(steps=STEPS, seeds=3, starts=1000, demonstrated=10_000),
    quick=TrainingScale(steps=24_576, seeds=1, starts=100, demonstrated=600),
    their_heads=("parked, %", "learning time", "remark"),
    columns=columns("late", "left", "wall", "block", "person"),
    plotted=PARKED,
    assumptions=(
        *ASSUMPTIONS,
        RATE_WORD,
        HALVES_WORD,
        ONE_WAY,
        BUMPS_WORD,
        "Its stages were made by hand and are not printed. Ours begin near the slot: of the zone "
        "at most 6, 12, 20 m away and then anywhere, of the yard at most 8, 16, 28, 42, 56 m. The "
        "next one begins once 80 % of the last 200 episodes park, and all within half of the "
        "training.",
        "It demonstrated by keyboard for 10 minutes, 10 000 steps. Here the driver `valet`, which "
        "plans its ways on the map, demonstrates as many decisions; each run makes them itself, "
        "outside of the processor times that are told.",
        "Strengths of curiosity and GAIL are not told: 0.02 and 0.01 as in the library's example "
        "Pyramids, which has the cloning of the report. Its network of curiosity has 256 "
        "features, ours 16.",
    ),
)
