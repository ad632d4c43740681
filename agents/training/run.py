"""A whole training run, from its settings to its folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from race_agents.policies.registry import BEST, CONFIG, POLICY
from race_agents.policies.session import Policy
from race_agents.policies.verification import MOST_DIFFERENCE, times_of
from race_agents.training import curve, folder
from race_agents.training.budget import Budget
from race_agents.training.callback import CURVE, LATEST, Tell, TrainingCallback
from race_agents.training.checkpoint import load_checkpoint
from race_agents.training.evaluation import Examiner, Marks
from race_agents.training.export import difference, export_policy, metadata_from
from race_agents.training.imitation import Imitation
from race_agents.training.learner import learner_of, world_of
from race_agents.training.lines import Say
from race_agents.training.normaliser import Normaliser
from race_agents.training.record_laps import record_laps
from race_agents.training.schedule import Schedule
from race_agents.training.self_play import SelfPlay
from race_agents.training.settings import Settings
from race_agents.training.tasks import evaluation_tasks
from race_server.errors import RaceError, ScenarioError
from race_server.scenario.sensors import Lidar
from race_server.scenario.track.sets import names_of

PARITY_STEPS = 200  # observations on which the file and the learner are compared
TIMED = 2000  # decisions that are timed
FRESH_SEEDS = 100_000  # offset of the seeds of the last evaluation from those that chose the policy


@dataclass
class TrainingResult:
    """Result of a run."""

    folder: Path
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
) -> TrainingResult:
    """Train, and write a complete folder; Ctrl-C ends the learning early, not the run.

    Raises:
        RaceError: the settings are not valid, or there is nothing to resume.
    """
    budget = Budget.of(settings)
    for tracks in (settings.evaluation.tracks, settings.evaluation.final):
        evaluation_tasks(settings, tracks)  # a wrong name is refused now, not after hours
    warn_of_lidar(settings, say)
    world = world_of(settings, budget)
    learner = learner_of(
        settings, world, budget, str(place / "tensorboard") if tensorboard else None
    )
    best_score = -np.inf
    if resume:
        best_score = load_checkpoint(place / BEST, learner, world, budget)
        load_checkpoint(place / LATEST, learner, world, budget)
        # Seeds other than at the beginning.
        learner.set_random_seed(settings.seed + budget.done)
        if budget.is_over:
            say("its budget is spent, so it learns nothing more: give it more, in all")
    known = _learned_on(settings)
    if known:
        say(
            f"evaluation.final: {', '.join(known)}: learned on as well, so the figures say nothing "
            "about unseen courses; choose others"
        )
    played = SelfPlay(settings, place, world, budget.done) if settings.self_play.seats else None
    folder.begin(place, settings)
    log = place / "tensorboard" / "race" if tensorboard else None
    callback = TrainingCallback(settings, place, world, budget, tell, best_score, played, log)
    try:
        stopped = _learn(settings, learner, world, callback, say)
        callback.examine()
        budget.stop()
        told = {
            "steps": budget.done,
            "minutes": budget.seconds / 60.0,
            "stopped": stopped,
            "resumed": resume,
            "learned_on": known,
        }
        # The latest is to resume from; the best is exported.
        load_checkpoint(place / BEST, learner, world, budget)
        document = _conclude(settings, place, learner, world, callback, told, say)
    finally:
        world.close()
        callback.examiner.close()
    return TrainingResult(place, document, stopped)


def _learned_on(settings: Settings) -> list[str]:
    """Return the courses of the last evaluation that are learned on as well."""
    learned = set(names_of(settings.tracks.names, settings.tracks.set))
    return [
        name
        for name in names_of(settings.evaluation.final.names, settings.evaluation.final.set)
        if name in learned
    ]


def warn_of_lidar(settings: Settings, say: Say) -> None:
    """Warn if a policy observes rays that are not among those of a race."""
    rays, gaps = metadata_from(settings, ()).lidar_rays, Lidar().rays - 1
    if rays and gaps % (rays - 1):
        fitting = ", ".join(str(gaps // every + 1) for every in range(1, 11) if not gaps % every)
        say(
            f"lidar.rays = {rays}: no race has these, so the policy cannot drive in one; choose "
            f"one of {fitting}"
        )


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
            callbacks = [callback, Schedule(settings, budget)]
            learner.learn(budget.steps_left, callback=callbacks, reset_num_timesteps=False)
    except KeyboardInterrupt:
        return True
    return False


def _imitate(
    settings: Settings, learner: Any, world: Normaliser, callback: TrainingCallback, say: Say
) -> None:
    callback.init_callback(learner)
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
) -> dict[str, Any]:
    """Export the best policy, verify the file, and write the results.

    told: more figures of the run.
    """
    path = place / POLICY
    export_policy(
        path,
        learner,
        world,
        metadata_from(settings, names_of(settings.tracks.names, settings.tracks.set)),
    )
    policy = Policy(path)
    tried = settings.evaluation
    examiner = Examiner(settings, tried.final, tried.first_seed + FRESH_SEEDS)
    seen = examiner.observations(policy.decide, PARITY_STEPS)
    parity = difference(policy, learner, world, seen)
    if parity > MOST_DIFFERENCE:
        raise ScenarioError(
            f"{path} differs from the learner by {parity:.1e}; at most "
            f"{MOST_DIFFERENCE:g} is rounding: report this with {CONFIG}"
        )
    marks = examiner.examine(policy.decide)
    examiner.close()
    document = folder.write_evaluation(
        place,
        marks,
        {
            "score": callback.best_score,
            "scored_by": tried.score,
            "seeds": tried.seeds,
            "seconds": tried.seconds,
            "parity": parity,
            "compared_observations": len(seen),
            "decision_us": times_of(policy, seen[:TIMED]).mean,
            "goal_reached": callback.reached,
            **told,
        },
    )
    curve.draw(place / CURVE, place / "curve.png", settings.title or place.name)
    _film(settings, place, marks, say)
    folder.write_readme(place, settings, document)
    return document


def _film(settings: Settings, place: Path, marks: list[Marks], say: Callable[[str], None]) -> None:
    """Record laps on the course where the policy is fastest."""
    lapped = [one for one in marks[:-1] if one.best_lap_s is not None]
    if not lapped:
        say("no lap was completed on the unseen courses: there is nothing to record")
        return
    track = max(lapped, key=lambda one: one.speed).track
    try:
        made = record_laps(
            place, place / POLICY, track, settings.vehicle, settings.evaluation.first_seed
        )
    except RaceError as error:
        say(f"the laps were not recorded: {error}")
        return
    if made is None:
        say(f"the laps on {track} were not recorded: their race did not end")
