"""What all reproductions of the report on an articulated vehicle in a car park share."""

from race_agents.reproductions.plan import Column, ParkingExam, Reproduction, TrainingScale, Variant

_SOURCE = "Report on an articulated vehicle that learns to park, with a heuristic in its reward"
_PRESET = "trailer-report-c"
_EXAM = ParkingExam()
_FULL = TrainingScale(steps=9_600_000, seeds=3, starts=1000)
_PPO_FULL = TrainingScale(steps=6_000_000, seeds=3, starts=1000)
_PPO_QUICK = TrainingScale(steps=262_144, seeds=1, starts=64)
# One update for 128 decisions, of a smaller network.
_QUICK = TrainingScale(
    steps=65_536,
    seeds=1,
    starts=64,
    changes=(
        "network.layers=[128, 64, 64]",
        "algorithm.options.batch_size=128",
        "algorithm.options.train_freq=4",
        "algorithm.options.learning_starts=4096",
        "parking.limit_s=60.0",
    ),
)

_PARKED = Column("parked", "parked, %", 1, of="starts")
_COLUMNS = (
    _PARKED,
    Column("aligned", "aligned, % of all", 1, of="starts"),
    Column("open_parked", "parked where nothing stands between, %", 1, of="open"),
    Column("barred_parked", "parked where something does, %", 1, of="barred"),
    *(
        Column(name, f"{name.replace('_', ' ')}, %", 1, of="starts", has_bounds=False)
        for name in ("late", "wall", "vehicle", "jack_knife", "own_body")
    ),
    Column("return", "return", 1),
    Column("length", "length, decisions", 0),
    Column("decisions_to_80", "decisions to 80 %", 0),
    Column("learning_cpu_s", "learning, CPU s", 0),
)

_ASSUMPTIONS = (
    "The report gives neither sizes nor speeds of its vehicle, nor the length of a step, the "
    "actions, the number of steps, the critical angle of the hitch, or where its sensors look: "
    "`lorry-off-axle`, 240 s for an episode, the 14 feelers, and, unless said below, decisions of "
    "0.1 s, one pedal and the wheel are our choice.",
    "Its curves have no numbers: breadth-first search is best in mean return, success and length "
    "of episodes, Euclid's distance later and lower, succeeding only where nothing stands between, "
    "and without a heuristic it never arrives.",
    "Returns of rows with different heuristics differ by construction: compare success. Each start "
    "is drawn by a seed that no training had.",
    "Something stands between if a wall or a parked vehicle is on the straight line from the "
    "middle of the tractor to where it is to stand.",
    "Decisions to 80 %: until the share of the last hundred episodes that parked, with "
    "exploration, first came to 80 %; the mean of the runs that came there.",
    "64 lots learn at once.",
)
SAC_ASSUMPTION = (
    "SAC makes one update for 32 decisions; a quick run has a smaller network, one update for 128 "
    "decisions, and 60 s for an episode."
)

# SAC makes 24 updates a second on a core, so three heuristics with three seeds take 32 hours. PPO
# does not learn the task with decisions of 0.1 s and a pedal: what it tries out cancels itself.
_PPO = (
    "algorithm.name=ppo",
    "algorithm.learning_rate=6e-4",
    "algorithm.last_learning_rate=5e-5",
    "algorithm.normalise_reward=true",
    "algorithm.options={n_steps = 64, batch_size = 4096, n_epochs = 4, gamma = 0.99, "
    "ent_coef = 2e-3}",
    "network={layers = [256, 256], activation = 'relu', log_std = -0.3}",
    "action=crawl",
    "parking.decision_ticks=30",
)
_PPO_ASSUMPTION = (
    "PPO in the place of SAC, which takes 3.5 hours of a core for each run. It decides every 0.5 s "
    "and answers with a speed instead of a pedal: with 0.1 s and a pedal it parked none of 200 "
    "after 3 million decisions, with 0.1 s and a speed 1 of 200 after 5 million."
)


def with_heuristic(name: str, *theirs: str) -> Variant:
    """Return a row of one heuristic."""
    return Variant(name, (f"parking.heuristic={name!r}",), theirs=theirs)


def table_of(
    title: str,
    *rows: Variant,
    finding: str,
    assumptions: tuple[str, ...],
    base: str = "",
    changes: tuple[str, ...] = (),
    full: TrainingScale = _FULL,
    quick: TrainingScale = _QUICK,
) -> Reproduction:
    """Return a table of the report.

    finding: what the report says of it; base: a row that all others are compared with; changes: of
    the preset, for all rows; assumptions: besides those of all tables.
    """
    return Reproduction(
        title=title,
        source=f"{_SOURCE}: {finding}",
        preset=_PRESET,
        changes=changes,
        rows=rows,
        exam=_EXAM,
        full=full,
        quick=quick,
        their_heads=("finding",),
        columns=_COLUMNS,
        plotted=_PARKED,
        base=base,
        assumptions=(*_ASSUMPTIONS, *assumptions),
    )


def heuristics_table_of(
    title: str, *rows: Variant, finding: str, base: str, assumptions: tuple[str, ...] = ()
) -> Reproduction:
    """Return a table of heuristics, by PPO; see `table_of`."""
    return table_of(
        title,
        *rows,
        finding=finding,
        assumptions=(_PPO_ASSUMPTION, *assumptions),
        base=base,
        changes=_PPO,
        full=_PPO_FULL,
        quick=_PPO_QUICK,
    )
