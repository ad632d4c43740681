"""All settings that the result of a training depends on, in frozen structures."""

from typing import Annotated, Any, Literal

from pydantic import Field

from race_agents.training.parking_settings import HurlSettings, ParkingSettings
from race_agents.training.policy_settings import PolicySettings
from race_agents.training.settings_table import Deviations, File, Table
from race_agents.training.warm_start_settings import WarmStart
from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.seeds import RESUMED
from race_server.envs.reality_gap import RealityGap

LEARNER = "learner"  # in the seats of self-play
PLANNER = "planner"  # the teacher in a lot
DECISION_TICKS = 3  # in a live race
FRESH_SEEDS = 100_000  # offset of the seeds of the last evaluation from those that chose the policy
GAMMA = 0.99  # of all algorithms, unless `algorithm.options.gamma` says otherwise
Range = tuple[float, float]
# Sizes of the hidden layers; larger ones than these fill a memory before they learn.
Width = Annotated[int, Field(gt=0, le=8192)]
Layers = Annotated[tuple[Width, ...], Field(min_length=1, max_length=32)]

ActionName = Literal[
    "continuous",
    "report_b",
    "increments",
    "discrete",
    "control",
    "residual",
    "park",
    "report_a_1",
    "report_a",
    "dock",
    "crawl",
]


class Algorithm(Table):
    """The learning algorithm. `options` are those of its class, most of Stable-Baselines3's."""

    name: Literal["ppo", "ppo-sb3", "mappo", "poca", "sac", "td3", "dqn"] = "ppo"
    learning_rate: float = Field(default=3e-4, gt=0.0)
    # At the end; falls evenly until then, from the moment the actor learns by reward.
    last_learning_rate: float | None = Field(default=None, ge=0.0)
    options: dict[str, Any] = Field(default={})
    normalise_reward: bool = True


class Network(Table):
    """The network of the actor; that of the critic has the same layers."""

    layers: Layers = (64, 64)
    activation: Literal["tanh", "relu"] = "tanh"
    log_std: float = -1.0  # PPO: logarithm of the first deviation of the actions
    # PPO: at the end. With it the deviation falls evenly; without it, it is learned.
    last_log_std: Deviations | None = None
    # PPO: what the untrained network answers; around zero a kart stands, as brakes are stronger.
    first_action: tuple[float, ...] = ()
    # PPO: of factors between two layers, where the processor has units for it. None: float32.
    products: Literal["bfloat16"] | None = None


class Lidar(Table):
    """The lidar of training. A race's has 201 rays: 101, 41 or 21 of them are among those."""

    rays: int = Field(default=201, ge=2, le=2048)
    noise: float = Field(default=0.01, ge=0.0)  # [m] standard deviation
    dropout: float = Field(default=0.0, ge=0.0, lt=1.0)  # share of rays that come back as 0
    # A network sees logarithms of the ranges, and a range instead of 0: see `view.py`.
    logarithms: bool = False


class RaceSettings(Table):
    """The other karts, and the rules: those of `race_server.scenario.race.Rules`."""

    karts: int = Field(default=1, ge=1, le=64)
    learners: int = Field(default=1, ge=1, le=64)
    opponents: tuple[str, ...] = ()
    # Numbers of karts, one drawn for each race, the last ones left out; none: always all.
    fields: tuple[int, ...] = ()
    rules: dict[str, Any] = Field(default={})
    # Half of the races have no items: boxes that are always there a policy takes for granted. None
    # is not written, so that digests of settings from before are as they were.
    half_without_items: bool | None = None

    @property
    def sizes(self) -> tuple[int, ...]:
        """The numbers of karts, one of which is drawn for each race."""
        return self.fields or (self.karts,)


class SelfPlaySettings(Table):
    """The drivers of the seats, drawn again for each stretch of the training.

    A seat is `learner`, `pool`, or the name of a driver. The pool: anchors, and earlier snapshots
    of the learner.
    """

    seats: tuple[str, ...] = ()  # of all karts; none: there is no self-play
    anchors: tuple[str, ...] = ("raceline", "idm", "follow_gap")
    stretch: int = Field(default=200_000, ge=1)  # decisions of learning karts
    snapshot: int = Field(default=400_000, ge=1)  # decisions from one snapshot to the next
    snapshots: int = Field(default=6, ge=1)  # that stay in the pool: the first and the newest
    share: float = Field(default=0.5, ge=0.0, le=1.0)  # of the pool's seats that snapshots take
    races: int = Field(default=8, ge=1)  # that rate each snapshot
    laps: int = Field(default=2, ge=1)  # of those races


class Episode(Table):
    """Where an episode begins and ends."""

    # Decisions until it is cut off; 0: the rules alone end it.
    steps: int = Field(default=1200, ge=0, lt=2**31)
    # Share of the races that begin at random places; true is all of them.
    random_start: float = Field(default=1.0, ge=0.0, le=1.0)
    random_grid: bool = False  # every race has a random order on the grid
    crash_range: float = Field(default=0.0, ge=0.0)  # [m] a nearer lidar range is a crash


class Tracks(Table):
    """A named set, or names; ``-reversed`` behind a name is the same course the other way."""

    set: str = ""
    names: tuple[str, ...] = ()


class Stage(Table):
    """A stage of the curriculum, in which only these tracks or lots are drawn; none: all of them.

    An episode succeeds if the kart completes `success_laps` in it and does not crash; in a lot, if
    the vehicle parks.
    """

    after: float = Field(ge=0.0, lt=1.0)  # share of the training at which it begins at the latest
    tracks: tuple[str, ...] = ()
    lots: tuple[str, ...] = ()
    # Least and greatest distance [m] from start to slot; none: as each lot has it.
    distance: Range | None = None
    # The next stage begins earlier once this share of the last `episodes` has succeeded.
    until_success: float | None = Field(default=None, gt=0.0, le=1.0)
    episodes: int = Field(default=200, ge=1)
    success_laps: int = Field(default=1, ge=0)


class Evaluation(Table):
    """The evaluation of the policy on courses and seeds that it does not learn on."""

    tracks: Tracks = Tracks(set="validation")  # during training, to choose the best policy
    final: Tracks = Tracks(set="unseen")  # at the end, with other seeds
    lots: tuple[str, ...] = ()  # instead of tracks; none: those of `parking`
    final_lots: tuple[str, ...] = ()  # the same at the end
    seeds: int = Field(default=4, ge=1)
    first_seed: int = Field(default=10_000, ge=0)
    times: int = Field(default=10, ge=1)  # during a training, the end included
    seconds: float = Field(default=60.0, gt=0.0)
    # The score of a policy: metres per second until a crash or the time limit; the return; or in a
    # lot the mean of the shares that park, and that park straight.
    score: Literal["speed", "return", "success"] = "speed"

    @property
    def final_seed(self) -> int:
        """The first seed at the end: those before have chosen the policy."""
        return self.first_seed + FRESH_SEEDS


class Goal(Table):
    """Training stops early once an evaluation reaches all of these; none: it never does."""

    speed: float | None = None  # [m/s] at least
    crash_rate: float | None = None  # at most
    best_lap_s: float | None = None  # at most
    parked: float | None = None  # share, at least
    aligned: float | None = None  # share of all episodes, at least
    hits: float | None = None  # share that ended in a collision, at most


class Cloning(Table):
    """Imitation of demonstrations beside PPO, in its first steps; without a file there is none.

    Further steps follow each of PPO's: their learning rate is `strength` times PPO's, and falls
    to zero (https://github.com/Unity-Technologies/ml-agents, its behavioural cloning).
    """

    demonstrations: File = ""  # a file of `race demonstrate`
    strength: float = Field(default=0.5, gt=0.0)
    steps: int = Field(default=150_000, ge=1)  # decisions of learning karts until it is over
    lessons: int = Field(default=8, ge=1)  # between two rollouts
    batch_size: int = Field(default=512, ge=1)


class Gail(Table):
    """Reward for driving like demonstrations; without them there is none."""

    demonstrations: File = ""  # a file of `race demonstrate`
    scale: float = Field(default=1.0, gt=0.0)
    own_share: float = Field(default=0.0, ge=0.0)  # of the race's own reward that stays
    layers: Layers = (64, 64)
    learning_rate: float = Field(default=3e-4, gt=0.0)
    decisions: int = Field(default=16, ge=1)  # of each kart between lessons of the discriminator
    lessons: int = Field(default=4, ge=1)
    batch_size: int = Field(default=256, ge=1)
    # Noise on what the discriminator learns from, in deviations, so that it is not too sure.
    blur: float = Field(default=0.1, ge=0.0)


class Curiosity(Table):
    """Reward for what could not be foreseen; without bonus there is none."""

    bonus: float = Field(default=0.0, ge=0.0)  # for a usual surprise
    # Greatest reward of a decision, where a surprise counts as it is; none: it counts beside the
    # mean of all so far, so that the reward falls more slowly than the surprise.
    most: float | None = Field(default=None, gt=0.0)
    features: int = Field(default=16, ge=1)
    hidden: int = Field(default=64, ge=1)
    forward_share: float = Field(default=0.2, ge=0.0, le=1.0)  # of the loss; the inverse's the rest
    learning_rate: float = Field(default=1e-3, gt=0.0)
    decisions: int = Field(default=16, ge=1)  # of each kart between lessons of its models
    batch_size: int = Field(default=256, ge=1)


class Settings(Table):
    """One run of training."""

    title: str = ""
    minutes: float | None = Field(default=None, gt=0.0)
    steps: int | None = Field(default=None, ge=1)  # decisions of learning karts; instead of minutes
    seed: int = Field(default=1, ge=0, lt=RESUMED)
    worlds: int = Field(default=64, ge=1)
    threads: int = Field(default=1, ge=1)  # of the worlds, and of PPO's lessons
    vehicle: str = "tt02"
    # That learn as well, each on every course; evaluations use the first one.
    more_vehicles: tuple[str, ...] = ()
    observation: str | tuple[str, ...] = ("lidar", "lidar_before", "speed", "steering")
    action: ActionName = "continuous"
    # In races and exams the policy brakes beyond this share of the speed of `follow_gap`; it learns
    # without that.
    scan_limit: float | None = Field(default=None, gt=0.0, le=10.0)
    # In rounds and exams of parking its commands are changed where it would soon touch something;
    # it learns without that.
    evades: bool | None = None
    simulator: str = ""  # that moves the vehicles: highway-env; empty: our own
    base: str = ""  # the driver that residual actions advise
    # Observations are clipped to this before they are normalised: without a kart nearby the
    # distance is 1000 m, beside which all near ones would look alike.
    horizon: float | None = Field(default=None, gt=0.0)
    reward: str | dict[str, float] = "progress"
    algorithm: Algorithm = Algorithm()
    network: Network = Network()
    lidar: Lidar = Lidar()
    gap: RealityGap = RealityGap()
    race: RaceSettings = RaceSettings()
    policies: tuple[PolicySettings, ...] = ()  # none: one, of all learners
    parking: ParkingSettings = ParkingSettings()
    hurl: HurlSettings = HurlSettings()
    self_play: SelfPlaySettings = SelfPlaySettings()
    episode: Episode = Episode()
    tracks: Tracks = Tracks(set="train")
    curriculum: tuple[Stage, ...] = ()
    warm_start: WarmStart = WarmStart()
    cloning: Cloning = Cloning()
    gail: Gail = Gail()
    curiosity: Curiosity = Curiosity()
    evaluation: Evaluation = Evaluation()
    goal: Goal = Goal()

    @property
    def parks(self) -> bool:
        """Whether it is to park that is learned, and not to race."""
        return bool(self.parking.lots)

    @property
    def mixes(self) -> bool:
        """Whether the learner mixes a heuristic into its targets, as HuRL does."""
        return self.parks and self.parking.shaping == "hurl"

    @property
    def gamma(self) -> float:
        """The discount of the learner."""
        return float(self.algorithm.options.get("gamma", GAMMA))

    @property
    def decision_ticks(self) -> int:
        """Ticks of 1/60 s from one decision to the next: as in a live race, or in a lot."""
        return self.parking.decision_ticks if self.parks else DECISION_TICKS

    @property
    def decision_s(self) -> float:
        """The time between two decisions [s]."""
        return self.decision_ticks / TICKS_PER_SECOND
