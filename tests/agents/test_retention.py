"""Pupils that learn and forget, and what is counted of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from race_agents.pupils.learner import Nature, Skill, after, made, nature_of
from race_agents.pupils.retention import (
    ALWAYS,
    FADING,
    NEVER,
    RetentionSpec,
    Schooling,
    interval_of,
    school_all,
    summary_of,
)
from race_server.errors import ScenarioError

# Does nine tenths of what it is told, learns half of what it feels, remembers, and never relapses.
APT = Nature(obeys=0.9, learns=0.5, remembers=1.0, relapses=0.0)


def test_help_takes_away_most_of_an_error_while_it_is_given() -> None:
    assert made(Skill(10.0, 10.0), APT, is_helped=True) == pytest.approx(1.0)
    assert made(Skill(10.0, 10.0), APT, is_helped=False) == 10.0


def test_a_pupil_learns_from_the_error_that_it_feels() -> None:
    # With help it feels 1 of 10 and learns half of that; alone, and told before, half of 10.
    helped = after(Skill(10.0, 10.0), APT, is_helped=True)
    assert helped.error == pytest.approx(9.5)
    assert after(helped, APT, is_helped=False).error == pytest.approx(4.75)


def test_a_pupil_that_was_never_told_does_not_learn() -> None:
    assert after(Skill(10.0, 10.0), APT, is_helped=False).error == 10.0


def test_old_habits_come_back_and_what_was_told_is_forgotten() -> None:
    dull = Nature(obeys=0.9, learns=0.5, remembers=0.5, relapses=0.1)
    skill = after(Skill(10.0, 0.0, known=0.8), dull, is_helped=False)
    assert skill.error == pytest.approx(1.0)
    assert skill.known == pytest.approx(0.4)


def test_natures_follow_from_seeds() -> None:
    assert nature_of(1) == nature_of(1)
    assert nature_of(1) != nature_of(2)


def test_a_gain_is_the_share_of_the_time_to_be_gained_that_stays() -> None:
    # 2 s too slow at first, 0.5 s too slow alone, in laps with errors that cost 0.2 s more.
    laps = (34.0, *[33.0] * 10, 32.7, 32.7, 32.7)
    flawless = (32.0, 32.2, 32.2, 32.2)
    assert Schooling(1, FADING, laps, (0,) * 14, flawless).gain == pytest.approx(0.75)


def test_the_first_lap_alone_shows_what_is_kept_before_a_pupil_learns_alone() -> None:
    # 2 s too slow at first; alone 1 s, then half a second, then no longer.
    laps = (34.0, *[33.0] * 10, 33.0, 32.5, 32.0)
    pupil = Schooling(1, ALWAYS, laps, (0,) * 14, (32.0,) * 4)
    assert pupil.gain_at_once == pytest.approx(0.5)
    assert pupil.gain == pytest.approx(0.75)


def test_a_pupil_whose_kart_does_it_feels_no_error_and_learns_nothing() -> None:
    nature = nature_of(1, is_driven=True)
    assert replace(nature, obeys=0.0) == replace(nature_of(1), obeys=0.0)
    assert made(Skill(10.0, 10.0), nature, is_helped=True) == 0.0
    assert after(Skill(10.0, 10.0), nature, is_helped=True).error == 10.0


def test_pupils_are_compared_with_themselves() -> None:
    schooled = [
        Schooling(
            seed, way, (34.0, *[33.0] * 10, *[alone + 0.1 * seed] * 3), (1,) * 14, (32.0,) * 4
        )
        for seed in (1, 2, 3)
        for way, alone in ((NEVER, 34.0), (ALWAYS, 33.0), (FADING, 32.5))
    ]
    figures = summary_of(schooled)
    assert figures["pupils"] == 3
    assert figures["faster_alone_after_fading_s"] == pytest.approx(0.5)
    # The same for every pupil, however fast each is.
    assert figures["faster_alone_after_fading_interval_s"] == pytest.approx((0.5, 0.5))


def test_an_interval_of_the_mean_is_about_two_standard_errors_to_each_side() -> None:
    values = np.random.default_rng(1).normal(3.0, 1.0, 400)
    low, high = interval_of(values)
    assert low == pytest.approx(values.mean() - 0.098, abs=0.02)
    assert high == pytest.approx(values.mean() + 0.098, abs=0.02)


def test_a_course_with_fewer_corners_than_a_pupil_has_habits_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    oval = SimpleNamespace(corners=("T1", "T2"))
    monkeypatch.setattr("race_agents.pupils.retention.School", lambda *_: oval)
    with pytest.raises(ScenarioError, match=r"track 'oval' has 2 corners for 'tt02', .* in 3"):
        next(school_all(RetentionSpec("oval", "tt02", range(1))))


def test_a_pupil_that_does_not_come_round_is_told_in_one_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("race_agents.pupils.retention.drive_lap", lambda *_: None)
    with pytest.raises(ScenarioError, match="pupil 7 does not come round on 'hangar-400'"):
        next(school_all(RetentionSpec("hangar-400", "kart-60", range(7, 8))))
