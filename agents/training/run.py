"""A run of training from its settings to its folder."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecNormalize

from agents.policies.session import Policy
from agents.policies.shelf import POLICY
from agents.training import curve, folder
from agents.training.checkpoint import load_checkpoint
from agents.training.courses import names_of
from agents.training.evaluation import Marks
from agents.training.export import MOST_DIFFERENCE, difference, export_policy, nature_from
from agents.training.film import record_laps
from agents.training.imitation import Imitation
from agents.training.learner import learner_of, world_of
from agents.training.overseer import BEST, CURVE, LATEST, Overseer, Tell
from agents.training.pace import Pace
from agents.training.schedule import Schedule
from agents.training.settings import Settings
from race_server.errors import RaceError, ScenarioError

PARITY_STEPS = 200  # decisions whose observations the file and the learner are compared on
TIMED = 2000  # decisions that are timed


@dataclass
class Outcome:
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
) -> Outcome:
    """Train, and leave a complete folder behind; Ctrl-C ends the learning early, not the run.

    Raises:
        RaceError: the settings make no training, or there is nothing to resume.
    """
    pace = Pace.of(settings)
    world = world_of(settings, pace)
    learner = learner_of(settings, world, pace, str(place / "tensorboard") if tensorboard else None)
    best_score = -np.inf
    if resume:
        load_checkpoint(place / LATEST, learner, world, pace)
        best_score = folder.read_evaluation(place).get("score", -np.inf)
    folder.begin(place, settings)
    overseer = Overseer(settings, place, world, pace, tell, best_score)
    imitation = _imitation(settings, learner, world, pace, say)
    try:
        stopped = _learn(learner, overseer, Schedule(settings, pace), imitation)
        overseer.examine()
        pace.stop()
        spent = pace.seconds, pace.done
        # The latest is for going on; what drives is the best.
        load_checkpoint(place / BEST, learner, world, pace)
        document = _conclude(settings, place, learner, world, overseer, spent, say)
    finally:
        world.close()
        overseer.examiner.close()
    return Outcome(place, document, stopped)


def _imitation(
    settings: Settings, learner: Any, world: VecNormalize, pace: Pace, say: Callable[[str], None]
) -> Imitation | None:
    """Return the warm start, if there is one that is not over yet."""
    warm = settings.warm_start
    if not warm.is_wanted or pace.share >= warm.share:
        return None
    return Imitation(settings, learner, world, say)


def _learn(
    learner: Any, overseer: Overseer, schedule: Schedule, imitation: Imitation | None
) -> bool:
    """Learn until the time is over; return whether a person ended it before."""
    pace = overseer.pace
    pace.start()
    if pace.is_over:
        return False
    try:
        if imitation is not None:
            overseer.init_callback(learner)
            imitation.go(pace, overseer.imitated)
            imitation.close()
        if not pace.is_over:
            callbacks = [overseer, schedule]
            learner.learn(pace.steps_left, callback=callbacks, reset_num_timesteps=False)
    except KeyboardInterrupt:
        return True
    return False


def _conclude(
    settings: Settings,
    place: Path,
    learner: Any,
    world: VecNormalize,
    overseer: Overseer,
    spent: tuple[float, int],
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Export the best policy, try the file out, and write down what came of it."""
    path = place / POLICY
    export_policy(path, learner, world, nature_from(settings, names_of(settings.tracks)))
    policy = Policy(path)
    seen = overseer.examiner.observations(policy.decide, PARITY_STEPS)
    parity = difference(policy, learner, world, seen)
    if parity > MOST_DIFFERENCE:
        raise ScenarioError(
            f"{path} answers otherwise than the learner, by {parity:.1e}; at most "
            f"{MOST_DIFFERENCE:g} is rounding: report this with {folder.CONFIG}"
        )
    marks = overseer.examiner.examine(policy.decide)
    document = folder.write_evaluation(
        place,
        marks,
        {
            "score": overseer.best_score,
            "scored_by": settings.evaluation.score,
            "seeds": settings.evaluation.seeds,
            "seconds": settings.evaluation.seconds,
            "parity": parity,
            "compared_observations": len(seen),
            "decision_us": decision_us(policy, seen),
            "steps": spent[1],
            "minutes": spent[0] / 60.0,
            "goal_reached": overseer.reached,
        },
    )
    curve.draw(place / CURVE, place / "curve.png", settings.title or place.name)
    _film(settings, place, marks, say)
    folder.write_readme(place, settings, document)
    return document


def decision_us(policy: Policy, seen: Any) -> float:
    """Return the time of one decision of a policy alone [µs]."""
    rows = [np.ascontiguousarray(row[None]) for row in seen[:TIMED]]
    begun = time.perf_counter()
    for row in rows:
        policy.decide(row)
    return 1e6 * (time.perf_counter() - begun) / len(rows)


def _film(settings: Settings, place: Path, marks: list[Marks], say: Callable[[str], None]) -> None:
    """Record laps on the course where the policy is fastest."""
    lapped = [one for one in marks[:-1] if one.best_lap_s is not None]
    if not lapped:
        say("no lap was completed on the unseen courses: there is nothing to record")
        return
    track = max(lapped, key=lambda one: one.speed).track
    try:
        record_laps(place, place / POLICY, track, settings.vehicle, settings.evaluation.first_seed)
    except RaceError as error:
        say(f"the laps were not recorded: {error}")
