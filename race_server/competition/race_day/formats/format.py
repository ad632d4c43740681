"""The format of an event: stages in order, as plain data."""

import re
from dataclasses import dataclass
from itertools import permutations

from race_server.competition.time_trial.run_spec import FLYING, STANDING
from race_server.errors import ScenarioError

# What counts of an attempt in a time trial: the time of all its laps, or its best clean lap.
RUN, LAP = "run", "lap"
COUNTED = (RUN, LAP)


@dataclass(frozen=True)
class Obstacles:
    """Fixed boxes of a car's size on a course, in measures of the car."""

    every_lengths: float = 18.0  # of centre line for each obstacle
    passage_widths: float = 2.4  # free beside each obstacle, between it and a border


@dataclass(frozen=True)
class TimeTrial:
    """Each team alone against the clock; its best attempt counts."""

    name: str
    track: str  # a letter
    laps: int = 2  # that are timed
    attempts: int = 2
    failure_s: float = 120.0  # the time of an attempt that failed; none may take longer
    obstacles: Obstacles | None = None
    best_points: int = 0  # for the fastest team, falling evenly …
    least_points: int = 0  # … to this for the slowest
    counts: str = RUN  # of an attempt, see COUNTED; where it is the lap, `race trial`'s rules hold
    start: str = STANDING  # or FLYING, with a lap before those that are timed

    @property
    def first_lap(self) -> int:
        """Number of the first lap that is timed."""
        return 2 if self.start == FLYING else 1


@dataclass(frozen=True)
class Races:
    """Races with several karts."""

    name: str
    tracks: str  # letters: one race on each
    laps: int
    rounds: int = 1
    most: int = 8  # karts in a race
    least: int = 2
    mixed: bool = False  # groups of equal strength; else the best in the first group
    qualified: int = 0  # number of teams that take part; 0: all
    points: tuple[int, ...] = ()  # by place
    finishing: int = 0  # points for finishing further behind
    limit_s: float = 60.0  # for each lap of a race


@dataclass(frozen=True)
class Format:
    """An event. Without points the last race decides, and before it the sum of the times."""

    name: str
    title: str
    stages: tuple[TimeTrial | Races, ...]

    @property
    def letters(self) -> str:
        """The tracks that it needs, as letters in order."""
        used = {letter for stage in self.stages for letter in _tracks_of(stage)}
        return "".join(sorted(used))

    def check_names(self, file: str, way_out: str = "give one of them another name") -> None:
        """Check that no two attempts, races or rounds can have the same title.

        Results, corrections and recordings are found by these titles.

        Raises:
            ScenarioError: two can.
        """
        for short, long in permutations(self.stages, 2):
            added = long.name.removeprefix(short.name)
            if added != long.name and _TITLES[type(short), type(long)].fullmatch(added):
                raise ScenarioError(
                    f"{file}: stage {long.name!r}: what is driven in it would be called as in "
                    f"stage {short.name!r}; {way_out}"
                )

    @property
    def has_points(self) -> bool:
        """Whether points decide."""
        return any(
            stage.best_points > 0 if isinstance(stage, TimeTrial) else bool(stage.points)
            for stage in self.stages
        )


def _tracks_of(stage: TimeTrial | Races) -> str:
    return stage.track if isinstance(stage, TimeTrial) else stage.tracks


# What a title adds to the name of a stage, as far as another stage may be called so: groups and
# rounds of races, the name of a team in a time trial, and the turn by which a round is kept.
_NEVER, _TURN = re.compile("(?!)"), re.compile(r" \d+")
_TITLES = {
    (Races, Races): re.compile(r"( \d+)?(, round \d+)?"),
    (TimeTrial, TimeTrial): re.compile(": .*"),
    (Races, TimeTrial): _TURN,
    (TimeTrial, Races): _NEVER,
}
