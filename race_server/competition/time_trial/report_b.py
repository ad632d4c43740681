"""Measurements in the report of the 1/10 race, to be shown beside our own figures.

Source of the lap times: the report's table 5.3, one lap of each trained network on the empty
validation track; of race day: its tables 5.4 and 5.5, the time of two laps from standstill. The
other teams of that day: photographs of the boards in
github.com/ajuton-ens/CourseVoituresAutonomesSaclay, folder Pictures (120 s: failed).
"""

from dataclasses import dataclass

# Likely, not proven, that this course is the report's validation track: see its file.
VALIDATION_TRACK = "covapsy-test-2023"


@dataclass(frozen=True)
class LapRow:
    """One network of the report's time trial."""

    network: str
    particularity: str
    lap: str  # as printed there
    crashes: str  # empty: it says nothing
    remark: str


LAPS = (
    LapRow("PPO 1", "base", "1:03.74", "0", "slow in bends"),
    LapRow("PPO 2", "crash worth -300 - crashes so far", "1:31.26", "1", "better one way round"),
    LapRow("PPO 3", "500 000 steps", "2:05.93", "1", "better one way round"),
    LapRow("PPO 4", "lambda 0.90", "none", "several", "fastest car, but no whole lap"),
    LapRow("PPO 5", "entropy 0.02", "2:25.27", "", "slow on straights, good in bends"),
    LapRow("PPO 6", "entropy 0.02, steering steps of 2°", "2:17.49", "", "slow, sways less"),
)


@dataclass(frozen=True)
class DayRow:
    """One team's qualification in 2023: two laps, two attempts each, in seconds."""

    team: str
    empty: tuple[int, int]
    obstacles: tuple[int, int]


RACE_DAY = (
    DayRow("ENS2, tentacles", (18, 21), (39, 35)),
    DayRow("ENSTA", (20, 19), (29, 120)),
    DayRow("ENS1, the report's PPO", (31, 25), (32, 34)),
    DayRow("Polytech1", (120, 23), (36, 46)),
)
