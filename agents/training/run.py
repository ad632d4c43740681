"""A run of training from its settings to its folder."""

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

PARITY_STEPS = 200  # decisions whose observations the file and the learner are compared on
TIMED = 2000  # decisions that are timed
FRESH_SEEDS = 100_000  # the last evaluation's seeds lie so far behind those that chose the policy


@dataclass
class TrainingResult:
    """What came of a run."""

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
    """Train, and leave a complete folder behind; Ctrl-C ends the learning early, not the run.

    Raises:
        RaceError: the settings make no training, or there is nothing to resume.
    """
    pace = Budget.of(settings)
    for tracks in (settings.evaluation.tracks, settings.evaluation.final):
        evaluation_tasks(settings, tracks)  # a wrong name is refused now, not after hours
    warn_of_lidar(settings, say)
    world = world_of(settings, pace)
    learner = learner_of(settings, world, pace, str(place / "tensorboard") if tensorboard else None)
    best_score = -np.inf
    if resume:
        best_score = load_checkpoint(place / BEST, learner, world, pace)
        load_checkpoint(place / LATEST, learner, world, pace)
        # Other worlds and other chances than at the beginning.
        learner.set_random_seed(settings.seed + pace.done)
        if pace.is_over:
            say("all of its time is over, so it learns nothing more: give it more, in all")
    known = _learned_on(settings)
    if known:
        say(
            f"evaluation.final: {', '.join(known)}: learned on as well, which tells nothing of "
            "unseen courses; choose others"
        )
    played = SelfPlay(settings, place, world, pace.done) if settings.self_play.seats else None
    folder.begin(place, settings)
    log = place / "tensorboard" / "race" if tensorboard else None
    overseer = TrainingCallback(settings, place, world, pace, tell, best_score, played, log)
    try:
        stopped = _learn(settings, learner, world, overseer, say)
        overseer.examine()
        pace.stop()
        told = {
            "steps": pace.done,
            "minutes": pace.seconds / 60.0,
            "stopped": stopped,
            "resumed": resume,
            "learned_on": known,
        }
        # The latest is for going on; what drives is the best.
        load_checkpoint(place / BEST, learner, world, pace)
        document = _conclude(settings, place, learner, world, overseer, told, say)
    finally:
        world.close()
        overseer.examiner.close()
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
    """Say so where a policy is to see rays that are not among those of a race."""
    rays, gaps = metadata_from(settings, ()).lidar_rays, Lidar().rays - 1
    if rays and gaps % (rays - 1):
        fitting = ", ".join(str(gaps // every + 1) for every in range(1, 11) if not gaps % every)
        say(
            f"lidar.rays = {rays}: no race shows these, so the policy will drive in none; choose "
            f"one of {fitting}"
        )


def _learn(
    settings: Settings, learner: Any, world: Normaliser, overseer: TrainingCallback, say: Say
) -> bool:
    """Learn until the time is over; return whether a person ended it before."""
    pace = overseer.pace
    try:
        if pace.share < settings.warm_start.end:
            _imitate(settings, learner, world, overseer, say)
        pace.start()
        if not (pace.is_over or overseer.reached):
            overseer.method = settings.algorithm.name
            callbacks = [overseer, Schedule(settings, pace)]
            learner.learn(pace.steps_left, callback=callbacks, reset_num_timesteps=False)
    except KeyboardInterrupt:
        return True
    return False


def _imitate(
    settings: Settings, learner: Any, world: Normaliser, overseer: TrainingCallback, say: Say
) -> None:
    overseer.init_callback(learner)
    imitation = Imitation(settings, learner, world, say)
    overseer.method = "imitation"
    overseer.pace.start()
    try:
        imitation.go(overseer.pace, overseer.imitated)
    finally:
        overseer.pace.stop()
        imitation.close()


def _conclude(
    settings: Settings,
    place: Path,
    learner: Any,
    world: Normaliser,
    overseer: TrainingCallback,
    told: dict[str, Any],
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Export the best policy, try the file out, and write down what came of it.

    told: what else is to be known of the run.
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
            f"{path} answers otherwise than the learner, by {parity:.1e}; at most "
            f"{MOST_DIFFERENCE:g} is rounding: report this with {CONFIG}"
        )
    marks = examiner.examine(policy.decide)
    examiner.close()
    document = folder.write_evaluation(
        place,
        marks,
        {
            "score": overseer.best_score,
            "scored_by": tried.score,
            "seeds": tried.seeds,
            "seconds": tried.seconds,
            "parity": parity,
            "compared_observations": len(seen),
            "decision_us": times_of(policy, seen[:TIMED]).mean,
            "goal_reached": overseer.reached,
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
        say(f"the laps on {track} were not recorded: their race did not come to its end")
