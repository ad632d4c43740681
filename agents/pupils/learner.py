"""A pupil that learns, forgets and leans on help: a model, to compare ways of helping.

A habit is kept as an error that the pupil makes when left alone. In a lap with help it does what
it is told and makes a small part of it, or none where the kart does it; left alone it makes all of
it. Learning follows the error that is felt, if the pupil knows what is right: what is told is
remembered for some laps. A part of the old habit comes back each lap. The first is the state space
of motor adaptation (Thoroughman and Shadmehr, Learning of action through adaptive combination of
motor primitives, 2000), the rest is the guidance hypothesis in its simplest form (Salmoni, Schmidt
and Walter, Knowledge of results and motor learning, 1984). It is no finding about people.
"""

from dataclasses import dataclass, replace

import numpy as np

# Ranges that a pupil's nature is drawn from.
OBEYS = (0.80, 0.95)  # share of the error that help takes away while it is given
LEARNS = (0.30, 0.60)  # share of the felt error that is learned from, each lap, by one who knows
REMEMBERS = (0.85, 0.98)  # share of what was told that is left after a lap
RELAPSES = (0.01, 0.04)  # share of the way back to the old habit, each lap


@dataclass(frozen=True)
class Nature:
    """How a pupil learns."""

    obeys: float
    learns: float
    remembers: float
    relapses: float


def nature_of(seed: int, *, is_driven: bool = False) -> Nature:
    """Return the nature of the pupil of a seed.

    is_driven: help is given by the kart itself, which brakes and accelerates: no error is left.
    """
    chance = np.random.default_rng([seed, 43])
    nature = Nature(
        *(float(chance.uniform(*bounds)) for bounds in (OBEYS, LEARNS, REMEMBERS, RELAPSES))
    )
    return replace(nature, obeys=1.0) if is_driven else nature


@dataclass(frozen=True)
class Skill:
    """One habit of a pupil: sizes in the unit of its fault."""

    habit: float  # at first
    error: float  # that it would make now if left alone
    known: float = 0.0  # how much it knows of what is right, 0 to 1


def made(skill: Skill, nature: Nature, *, is_helped: bool) -> float:
    """Return the error that is made in a lap."""
    return skill.error * (1.0 - nature.obeys) if is_helped else skill.error


def after(skill: Skill, nature: Nature, *, is_helped: bool) -> Skill:
    """Return a habit after a lap, with help for it or without."""
    known = 1.0 if is_helped else nature.remembers * skill.known
    learned = nature.learns * known * made(skill, nature, is_helped=is_helped)
    left = skill.error - learned
    return Skill(skill.habit, left + nature.relapses * (skill.habit - left), known)
