"""Report of the 1/10 race, 2023, table 5.3: six networks on the empty validation track."""

from dataclasses import replace

from race_agents.reproductions.plan import Column, Exam, Reproduction, TrainingScale, Variant
from race_agents.reproductions.report_b import (
    ASSUMPTIONS,
    GROWING_CRASH,
    OWN,
    STEPS_OF_2,
    as_printed,
)
from race_agents.training.settings import Tracks
from race_server.competition.time_trial.report_b import LAPS, VALIDATION_TRACK, LapRow

_ENTROPY = "algorithm.options.ent_coef=0.02"
_PARTICULAR = (
    Variant("PPO 1: base", twist=OWN),
    Variant("PPO 2: growing crash", twist=GROWING_CRASH),
    Variant("PPO 3: half the steps", twist=OWN, steps_share=0.5),
    Variant("PPO 4: lambda 0.90", ("algorithm.options.gae_lambda=0.90",), OWN),
    Variant("PPO 5: entropy 0.02", (_ENTROPY,), OWN),
    Variant(
        "PPO 6: entropy 0.02, steps of 2°",
        (_ENTROPY,),
        STEPS_OF_2,
    ),
)
_PRINTED = as_printed("PPO 1")


def seconds_of(lap: str) -> float | None:
    """Return a lap time as the report prints it [s]; None where there is none."""
    minutes, colon, seconds = lap.partition(":")
    return 60.0 * int(minutes) + float(seconds) if colon else None


def _beside(row: Variant, lap: LapRow) -> Variant:
    """Return a row with what the report says of it."""
    theirs = (lap.lap, lap.crashes or "–", lap.remark)
    return replace(row, theirs=theirs, their_number=seconds_of(lap.lap))


REPRODUCTION = Reproduction(
    title="Time trial of six networks on the empty validation track",
    source="Report of the 1/10 race, table 5.3: one lap of each trained network",
    preset="report-b",
    rows=(*(_beside(row, lap) for row, lap in zip(_PARTICULAR, LAPS, strict=True)), _PRINTED),
    exam=Exam(
        Tracks(names=(VALIDATION_TRACK, f"{VALIDATION_TRACK}-reversed")),
        alone=True,
        random_start=False,
        seeds=1,
    ),
    full=TrainingScale(steps=1_000_000, seeds=3, exam_s=180.0),
    quick=TrainingScale(steps=20_480, seeds=1, exam_s=180.0),
    their_heads=("lap", "crashes", "remark"),
    columns=(
        Column("median_lap_s", "median lap, s"),
        Column("best_lap_s", "best lap, s"),
        Column("laps", "laps", 1),
        Column("crashes", "crashes", 1),
        Column("speed", "speed, m/s"),
    ),
    plotted=Column("median_lap_s", "lap, s"),
    better="lower",
    assumptions=(
        *ASSUMPTIONS,
        f"{VALIDATION_TRACK} is likely, not certainly, the report's validation track.",
        "Its figures are of one lap, with one network of each kind. Ours drive for 180 s in each "
        "direction, and start again from the grid after each crash.",
        "It prints 500 000 episodes for PPO 3 where the others have 1 000 000; both are read as "
        "steps.",
        "It prints a clip range of 0.02 among values that are otherwise the library's defaults; "
        "ours is the default, 0.2.",
    ),
)
