"""A whole training run, from its settings to its folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from race_agents.policies.registry import (
    BEST,
    CONFIG,
    POLICY,
    policy_path,
    run_folder,
)
from race_agents.policies.session import Policy
from race_agents.policies.verification import MOST_DIFFERENCE, times_of
from race_agents.training import curve, folder
from race_agents.training.budget import Budget
from race_agents.training.callback import CURVE, Tell, TrainingCallback
from race_agents.training.checkpoint import begin_with, load_checkpoint
from race_agents.training.companion_callbacks import callbacks_beside
from race_agents.training.divergence import ENDED, has_diverged
from race_agents.training.evaluation import Examiner, Marks
from race_agents.training.export import difference, export_policy, metadata_from
from race_agents.training.far_ppo import Crew, FarKarts, FarPpo
from race_agents.training.film import record_laps, record_parking
from race_agents.training.imitation import Imitation
from race_agents.training.learner import learner_of, world_of
from race_agents.training.lines import Say, find_lines_shown
from race_agents.training.normaliser import Normaliser
from race_agents.training.policy_start import begin_with_policy
from race_agents.training.race_marks import RaceMarks
from race_agents.training.resumption import restored
from race_agents.training.self_play import SelfPlay
from race_agents.training.settings import Settings
from race_agents.training.tasks import (
    courses_of,
    evaluation_tasks,
    final_courses,
    training_task,
    validation_courses,
)
from race_server.envs.sb3 import KartVecEnv
from race_server.envs.task import Task
from race_server.errors import RaceError, ScenarioError
from race_server.scenario.sensors import Lidar

PARITY_STEPS = 200  # observations on which the file and the learner are compared
TIMED = 2000  # decisions that are timed
LEARNED_ON = "learned on as well, so the figures say nothing about unseen courses; choose others"


@dataclass
class TrainingResult:
    """Result of a run."""

    folder: Path
    marks: list[Marks]
    evaluation: dict[str, Any]
    stopped: bool = False  # by a person


def train(
    settings: Settings,
    place: Path,
    *,
    resume: bool = False,
    tell: Tell = lambda _: None,
    say: Callable[[str], None] = lambda _: None,
    tensorboard: bool = False,
    karts: KartVecEnv | None = None,
    company: tuple[str, ...] = (),
    crew: Crew | None = None,
) -> TrainingResult:
    """Train, and write a complete folder; Ctrl-C ends the learning early, not the run.

    karts: that learn; default: a new batch's. company: policies that learn in the same races. crew:
    runners that collect what is learned from.

    Raises:
        RaceError: the settings are not valid, or there is nothing to resume.
    """
    budget = Budget.of(settings)
    tasks = tasks_here(settings, learns=karts is None and crew is None)
    warn_of_lidar(settings, say)
    find_lines_shown(tasks, settings.threads, say)
    logs = str(place / "tensorboard") if tensorboard else None
    world, learner = _begun(settings, budget, logs, karts, crew)
    best_score = -np.inf
    if settings.warm_start.run and not resume:
        begin_with(run_folder(settings.warm_start.run) / BEST, learner, world)
    if settings.warm_start.policy and not resume:
        begin_with_policy(policy_path(settings.warm_start.policy), learner, world)
    if resume:
        best_score = restored(settings, place, learner, world, budget, say)
    if known := _learned_on(settings):
        say(f"evaluation.final: {', '.join(known)}: {LEARNED_ON}")
    played = SelfPlay(settings, place, world, budget.done) if settings.self_play.seats else None
    log = place / "tensorboard" / "race" if tensorboard else None
    callback = TrainingCallback(settings, place, world, budget, tell, best_score, played, log)
    callback.init_callback(learner)
    done = budget.done
    try:
        with folder.begun(place, settings, lambda: budget.done > done):
            stopped, diverged = _learned(settings, place, learner, world, callback, say)
        budget.stop()
        told = {
            "steps": budget.done,
            "minutes": budget.seconds / 60.0,
            "stopped": stopped,
            "resumed": resume,
            "learned_on": known,
            **({"diverged": True} if diverged else {}),
            **({"learned_with": list(company)} if company else {}),
        }
        # The latest is to resume from; the best is exported.
        load_checkpoint(place / BEST, learner, world, budget)
        marks, document = _conclude(settings, place, learner, world, callback, told, say)
    finally:
        world.close()
        callback.examiner.close()
    return TrainingResult(place, marks, document, stopped)


def tasks_here(settings: Settings, *, learns: bool) -> list[Task]:
    """Return the tasks whose worlds are built here: evaluations, and what is learned if `learns`.

    Raises:
        RaceError: a name is wrong, which is said now and not after hours.
    """
    tasks = [training_task(settings)] if learns else []
    for courses in (validation_courses(settings), final_courses(settings)):
        tasks += evaluation_tasks(settings, courses).values()
    return tasks


def _begun(
    settings: Settings,
    budget: Budget,
    logs: str | None,
    karts: KartVecEnv | None,
    crew: Crew | None,
) -> tuple[Normaliser, Any]:
    """Return the world of a learner, and the learner; of a crew's they are far away."""
    if crew is None:
        world = world_of(settings, budget, karts=karts)
        return world, learner_of(settings, world, budget, logs)
    world = world_of(settings, budget, karts=FarKarts(settings))
    return world, learner_of(settings, world, budget, logs, {"crew": crew}, FarPpo)


def _learned_on(settings: Settings) -> list[str]:
    """Return the tracks of the last evaluation that are learned on as well.

    In a lot the seed decides what is drawn, so there the seeds are held out.
    """
    learned = () if settings.parks else courses_of(settings)
    return [name for name in final_courses(settings) if name in learned]


def warn_of_lidar(settings: Settings, say: Say) -> None:
    """Warn if a policy observes rays that are not among those of a race."""
    rays, gaps = metadata_from(settings, ()).lidar_rays, Lidar().rays - 1
    if rays and gaps % (rays - 1):
        fitting = ", ".join(str(gaps // every + 1) for every in range(1, 11) if not gaps % every)
        say(
            f"lidar.rays = {rays}: no race has these, so the policy cannot drive in one; choose "
            f"one of {fitting}"
        )


def _learned(
    settings: Settings,
    place: Path,
    learner: Any,
    world: Normaliser,
    callback: TrainingCallback,
    say: Say,
) -> tuple[bool, bool]:
    """Learn, and evaluate what was learned last; return whether a person, or divergence, ended it.

    Raises:
        ScenarioError: it has diverged before its first evaluation.
    """
    try:
        stopped = _learn(settings, learner, world, callback, say)
        callback.examine()
    except Exception as error:  # what is no number is noticed in many places
        if not has_diverged(learner):
            raise
        if not (place / BEST).exists():
            raise ScenarioError(
                "the network has diverged before its first evaluation: choose a smaller "
                f"algorithm.learning_rate than {settings.algorithm.learning_rate:g}"
            ) from error
        say(ENDED)
        return False, True
    return stopped, False


def _learn(
    settings: Settings, learner: Any, world: Normaliser, callback: TrainingCallback, say: Say
) -> bool:
    """Learn until the budget is spent; return whether Ctrl-C ended it before."""
    budget = callback.budget
    try:
        if budget.share < settings.warm_start.end:
            _imitate(settings, learner, world, callback, say)
        budget.start()
        if not (budget.is_over or callback.reached):
            callback.method = settings.algorithm.name
            callbacks = [callback, *callbacks_beside(settings, world, budget)]
            learner.learn(budget.steps_left, callback=callbacks, reset_num_timesteps=False)
    except KeyboardInterrupt:
        say(
            "interrupted: the best policy is evaluated and written now, which takes up to a "
            "minute; Ctrl-C again leaves without, and --resume continues"
        )
        return True
    return False


def _imitate(
    settings: Settings, learner: Any, world: Normaliser, callback: TrainingCallback, say: Say
) -> None:
    imitation = Imitation(settings, learner, world, say)
    callback.method = "imitation"
    callback.budget.start()
    try:
        imitation.go(callback.budget, callback.imitated)
    finally:
        callback.budget.stop()
        imitation.close()


def _conclude(
    settings: Settings,
    place: Path,
    learner: Any,
    world: Normaliser,
    callback: TrainingCallback,
    told: dict[str, Any],
    say: Callable[[str], None],
) -> tuple[list[Marks], dict[str, Any]]:
    """Export the best policy, verify the file, and write the results.

    told: more figures of the run.
    """
    path = place / POLICY
    export_policy(path, learner, world, metadata_from(settings, courses_of(settings)))
    policy = Policy(path)
    tried = settings.evaluation
    examiner = Examiner(settings, final_courses(settings), tried.final_seed)
    seen = examiner.observations(policy.decide, PARITY_STEPS)
    parity = difference(policy, learner, world, seen)
    if parity > MOST_DIFFERENCE:
        raise ScenarioError(
            f"{path} differs from the learner by {parity:.1e}; at most "
            f"{MOST_DIFFERENCE:g} is rounding: report this with {CONFIG}"
        )
    marks = examiner.examine(policy.decide)
    examiner.close()
    document = folder.evaluation_of(
        marks,
        {
            "score": callback.best_score,
            "scored_by": tried.score,
            "seeds": tried.seeds,
            "seconds": None if settings.parks else tried.seconds,
            "parity": parity,
            "compared_observations": len(seen),
            "decision_us": times_of(policy, seen[:TIMED]).mean,
            "goal_reached": callback.reached,
            **told,
        },
    )
    curve.draw(place / CURVE, place / "curve.png", settings.title or place.name)
    _film(settings, place, marks, say)
    folder.write_readme(place, settings, marks, document)
    folder.write_evaluation(place, document)
    return marks, document


def _film(settings: Settings, place: Path, marks: list[Marks], say: Callable[[str], None]) -> None:
    """Record the policy: on the track where it is fastest, or in the first lot."""
    try:
        made = _filmed(settings, place, marks)
    except RaceError as error:
        say(f"the policy was not recorded: {error}")
        return
    if made is None:
        say("the policy was not recorded: no lap was completed, or the race did not end")


def _filmed(settings: Settings, place: Path, marks: list[Marks]) -> Path | None:
    policy, seed = place / POLICY, settings.evaluation.first_seed
    if settings.parks:
        (task, *_) = evaluation_tasks(settings, final_courses(settings)).values()
        return record_parking(
            place,
            policy,
            task.scenarios[0],
            seed,
            settings.decision_ticks,
            settings.race.learners,
            tuple(map(str, task.opponents)),
        )
    lapped = [one for one in marks[:-1] if isinstance(one, RaceMarks) and one.best_lap_s]
    if not lapped:
        return None
    track = max(lapped, key=lambda one: one.speed).track
    return record_laps(place, policy, track, settings.vehicle, seed)
