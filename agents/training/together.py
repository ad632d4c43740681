"""Several policies that learn in the same races, each into the folder of a run."""

import threading
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from race_agents.training import folder
from race_agents.training.callback import LATEST, Tell, TrainingProgress
from race_agents.training.checkpoint import elapsed_in
from race_agents.training.lines import Say, find_lines_shown
from race_agents.training.resumption import is_complete
from race_agents.training.run import TrainingResult, tasks_here, train
from race_agents.training.seats import OtherEnded, Seats, SharedRaces, shared_task
from race_agents.training.settings import Settings
from race_server.core.seeds import resumed_seed

COMPLETE = "it has learned for all its time and is evaluated, so its karts roll"
WAIT_S = 0.2  # between two looks at what a person types


def settings_of_each(settings: Settings) -> tuple[Settings, ...]:
    """Return the settings of each policy as if it learned alone, among scripted drivers.

    So it is evaluated: the seats of the other policies belong to `race.opponents`, too.
    """
    learners, steps = settings.race.learners, settings.steps
    return tuple(
        settings.model_copy(
            update={
                "title": f"{settings.title or 'Policies'}: {one.name}",
                "policies": (),
                "steps": None if steps is None else max(steps * one.karts // learners, 1),
                "vehicle": one.vehicle or settings.vehicle,
                "observation": one.observation or settings.observation,
                "reward": one.reward or settings.reward,
                "race": settings.race.model_copy(update={"learners": one.karts}),
            }
        )
        for one in settings.policies
    )


@dataclass
class Company:
    """Policies on their way: one batch, a thread for each."""

    settings: Settings
    place: Path
    options: dict[str, Any]  # of `train`
    tell: Tell
    say: Say
    results: dict[int, TrainingResult] = field(default_factory=dict)
    errors: list[BaseException] = field(default_factory=list)
    complete: set[int] = field(default_factory=set)  # that have nothing to resume

    def __post_init__(self) -> None:
        """Build the races.

        Raises:
            RaceError: the settings are not valid.
        """
        owns, seed = settings_of_each(self.settings), None
        if self.options["resume"]:
            # That of no race so far, by what all have learned from.
            homes = [self.place / one.name for one in self.settings.policies]
            seed = resumed_seed(self.settings.seed, sum(map(_decisions_of, homes, owns)))
            self.complete = {n for n, home in enumerate(homes) if is_complete(home, owns[n])}
        self.races = SharedRaces(self.settings, seed)
        self.seats = [Seats(self.races, self.settings, number) for number in range(len(owns))]

    def learn(self, number: int, own: Settings) -> None:
        """Train one policy, in its thread."""
        turns, name = self.races.turns, self.settings.policies[number].name
        home = self.place / name
        turns.wait(number)
        try:
            # Once all are complete, each says so.
            if number in self.complete and len(self.complete) < turns.count:
                self.say(f"{name}: {COMPLETE}")
            elif not turns.failed:
                home.mkdir(exist_ok=True)
                self.results[number] = self._trained(number, own, home)
        except OtherEnded:
            pass
        except BaseException as error:  # it is raised where the training was asked for
            self.errors.append(error)
            turns.failed = True
            if not self.options["resume"]:
                folder.abandon(home)
        finally:
            self.races.leave(number, self.seats[number].karts)

    def _trained(self, number: int, own: Settings, home: Path) -> TrainingResult:
        name, names = home.name, [one.name for one in self.settings.policies]
        return train(
            own,
            home,
            tell=lambda news: self.tell(_named(news, name, shows=number == 0)),
            say=lambda text: self.say(f"{name}: {text}"),
            karts=self.seats[number],
            company=tuple(other for other in names if other != name),
            **self.options,
        )


def train_together(
    settings: Settings,
    place: Path,
    *,
    resume: bool = False,
    tell: Tell = lambda _: None,
    say: Say = lambda _: None,
    tensorboard: bool = False,
) -> list[TrainingResult]:
    """Train all policies of settings, each into a folder of its name in `place`.

    Ctrl-C ends the learning of all early, not the run. What is resumed has results only for those
    that were not complete.

    Raises:
        RaceError: the settings are not valid, or there is nothing to resume.
    """
    options = {"resume": resume, "tensorboard": tensorboard}
    # All of them now: Ctrl-C reaches the processes that look for them from this thread only.
    alone = [task for own in settings_of_each(settings) for task in tasks_here(own, learns=False)]
    find_lines_shown([shared_task(settings), *alone], settings.threads, say)
    company = Company(settings, place, options, tell, say)
    if not resume:
        folder.begin(place, settings)
    threads = [
        threading.Thread(target=company.learn, args=(number, own), daemon=True)
        for number, own in enumerate(settings_of_each(settings))
    ]
    for thread in threads:
        thread.start()
    _await(threads, company.races)
    company.races.batch.close()
    if company.errors:
        raise company.errors[0]
    if resume:
        folder.begin(place, settings)
    return [company.results[number] for number in sorted(company.results)]


def _decisions_of(home: Path, own: Settings) -> int:
    """Return from how many decisions a policy had learned that is resumed."""
    return elapsed_in(home / LATEST, own).done if (home / LATEST).exists() else 0


def _await(threads: list[threading.Thread], races: SharedRaces) -> None:
    """Wait for all threads; the first Ctrl-C stops the learning, the second leaves at once."""
    while any(thread.is_alive() for thread in threads):
        try:
            for thread in threads:
                thread.join(WAIT_S)
        except KeyboardInterrupt:
            if races.turns.stopped:
                raise
            races.turns.stopped = True


def _named(news: TrainingProgress, name: str, *, shows: bool) -> TrainingProgress:
    """Return the progress of one policy, with its name where it would be taken for another's."""
    return replace(news, stage=name if shows or news.marks is not None else news.stage)
