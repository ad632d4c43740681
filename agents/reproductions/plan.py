"""A reproduction: rows of settings, the report's figures beside them, and the columns to show."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Protocol, Self

from race_agents.training.settings import Settings, Tracks
from race_server.errors import ScenarioError


@dataclass(frozen=True)
class Twist:
    """Peculiarities of a report that settings of a training cannot express."""

    # Observations by running means, divided by their largest values, or as they are.
    scaling: Literal["running", "largest", "none"] = "running"
    choices: bool = False  # the policy picks among increments: DQN knows no other actions
    steering_share: float = 1.0  # of the 9° of a full increment
    growing_crash: bool = False  # a crash costs one more than the crash before


@dataclass(frozen=True)
class Learned:
    """What came out of a training and its exam."""

    steps: int  # decisions
    figures: dict[str, Any]
    curve: list[tuple[int, float]]
    # Further curves by name, see `race_agents.reproductions.watch`.
    curves: dict[str, list[tuple[float, float]]] = field(default_factory=dict)


class Lesson(Protocol):
    """A training and its exam that settings cannot express; its representation names it."""

    def give(self, settings: Settings, starts: int, tell: Callable[[float], None]) -> Learned:
        """Train, and examine from that many starts. tell: takes the share that is done.

        Raises:
            RaceError: the settings are not valid, or something is not there.
        """


@dataclass(frozen=True)
class Variant:
    """One line of the table: what is changed, and what the report found."""

    name: str
    changes: tuple[str, ...] = ()  # of the reproduction's settings, as `race train --set`
    twist: Twist = Twist()
    theirs: tuple[str, ...] = ()  # texts, one for each of `their_heads`
    their_number: float | None = None  # what the plot shows beside ours
    steps_share: float = 1.0  # of the reproduction's decisions
    quick_changes: tuple[str, ...] = ()  # besides, where a quick run has too few decisions
    # What imitates demonstrations, of `gail` and `cloning`; see `demonstration.py`.
    imitates: tuple[str, ...] = ()
    lesson: Lesson | None = None  # instead of learning by the settings alone


@dataclass(frozen=True)
class TrainingScale:
    """The amount of training."""

    steps: int  # decisions of each run
    seeds: int  # runs of each row
    exam_s: float = 0.0  # [s] of driving, for each start and track
    starts: int = 0  # of parking, in each lot
    demonstrated: int = 0  # decisions of a demonstration
    changes: tuple[str, ...] = ()  # of settings, so that few steps suffice


@dataclass(frozen=True)
class Exam:
    """How a trained policy is examined: it starts again after each crash until the time is over."""

    tracks: Tracks
    alone: bool  # otherwise among the karts of the training
    random_start: bool
    seeds: int = 4
    seconds: float = 180.0  # of driving, for each seed and track

    curve_head: ClassVar[str] = "return of an episode, mean of the last 100"

    def at(self, scale: TrainingScale) -> Self:
        """Return the exam of a training of this amount."""
        return replace(self, seconds=scale.exam_s)

    def words(self, scale: TrainingScale) -> str:
        """Return a text on how a policy is examined."""
        tracks = (f"the tracks of the set {self.tracks.set!r}",) if self.tracks.set else ()
        where = " and ".join((*self.tracks.names, *tracks))
        starts = "one start" if self.seeds == 1 else f"{self.seeds} starts"
        company = "alone" if self.alone else "among the other cars"
        return (
            f"each then drives {scale.exam_s:g} s without exploration from {starts} "
            f"on each of {where}, {company}, starting again after a crash"
        )


@dataclass(frozen=True)
class ParkingExam:
    """How a policy that parks is examined: once from each of many starts in the lot it learned in.

    The seeds of the starts are far from those of training.
    """

    starts: int = 0  # as the amount of training says

    curve_head: ClassVar[str] = "share of the last 100 episodes that parked"

    def at(self, scale: TrainingScale) -> Self:
        """Return the exam of a training of this amount."""
        return replace(self, starts=scale.starts)

    def words(self, scale: TrainingScale) -> str:
        """Return a text on how a policy is examined."""
        return (
            f"each then parks from {scale.starts} starts that no training had, without exploration"
        )


@dataclass(frozen=True)
class Column:
    """A figure that is shown, see `race_agents.reproductions.exam.Figures`.

    A count may be shown as a percentage of another one, with its interval of 95 %.
    """

    key: str
    head: str
    digits: int = 2
    of: str = ""  # the other count
    has_bounds: bool = True  # of a percentage


# How a policy drives in an exam on tracks, and what it took to learn that.
DRIVING = (
    Column("speed", "speed, m/s"),
    Column("crashes_per_minute", "crashes/min", 1),
    Column("laps", "laps", 1),
    Column("learning_cpu_s", "learning, CPU s", 0),
)


@dataclass(frozen=True)
class Reproduction:
    """A table of a report."""

    title: str
    source: str  # where the report's figures stand
    preset: str
    rows: tuple[Variant, ...]
    exam: Exam | ParkingExam
    full: TrainingScale
    quick: TrainingScale
    their_heads: tuple[str, ...]
    columns: tuple[Column, ...]
    plotted: Column
    better: Literal["higher", "lower"] = "higher"
    changes: tuple[str, ...] = ()  # of the preset, for all rows
    assumptions: tuple[str, ...] = ()  # what the report does not say, and what is different here
    base: str = ""  # a row that all others are compared with

    def runs_of(self, row: Variant, scale: TrainingScale) -> int:
        """Return the number of runs of a row: one where nothing is learned, as all are equal."""
        return scale.seeds if row.steps_share else 1

    def runs_wanted(self, scale: TrainingScale) -> int:
        """Return the number of runs of all rows."""
        return sum(self.runs_of(row, scale) for row in self.rows)

    def rows_named(self, text: str) -> tuple[str, ...]:
        """Return the names of the rows of a comma-separated list.

        The beginning of a name is enough if it is unique. Names may contain commas.

        Raises:
            ScenarioError: there is no such row, or several names begin so.
        """
        parts, found = text.split(","), list[str]()
        while parts:
            ends = range(len(parts), 0, -1)
            rows = {end: self._rows_like(",".join(parts[:end])) for end in ends}
            fitting = [end for end in ends if len(rows[end]) == 1]
            if not fitting:
                known = "; ".join(rows[1]) or "; ".join(row.name for row in self.rows)
                raise ScenarioError(
                    f"row {parts[0].strip()!r} is {'not the only one' if rows[1] else 'unknown'}; "
                    f"choose from {known}"
                )
            found += rows[fitting[0]]
            del parts[: fitting[0]]
        return tuple(dict.fromkeys(found))

    def _rows_like(self, words: str) -> list[str]:
        """Return the row of this name, or else all whose names begin so."""
        words, names = words.strip().lower(), [row.name for row in self.rows]
        same = [name for name in names if name.lower() == words]
        return same or [name for name in names if words and name.lower().startswith(words)]

    @property
    def plotted_word(self) -> str:
        """Return the plotted figure, without its unit."""
        return self.plotted.head.split(",")[0]
