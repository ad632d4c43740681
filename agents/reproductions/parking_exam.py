"""Figures of a policy that parks: counts of how its episodes ended, from starts held out."""

from statistics import fmean
from typing import Any

from race_agents.reproductions.exam import FIRST_SEED
from race_agents.reproductions.plan import ParkingExam
from race_agents.training.evaluation import Examiner
from race_agents.training.race_marks import Decide
from race_agents.training.settings import Settings
from race_agents.training.tasks import validation_courses
from race_server.competition.parking_tally import ParkingTally
from race_server.competition.team_tally import TeamTally
from race_server.core.messages import Ending
from race_server.envs.parking.reward_terms import ENDINGS

# How an episode can fail. A driver of an exam never withdraws.
FAILURES = (*ENDINGS[Ending.LATE : Ending.WITHDREW], *ENDINGS[Ending.JACK_KNIFE :])


def examine_parking(settings: Settings, exam: ParkingExam, decide: Decide) -> dict[str, Any]:
    """Park from each start once, and return figures; shares are told as counts."""
    tried = settings.evaluation.model_copy(update={"seeds": exam.starts})
    asked = settings.model_copy(update={"evaluation": tried})
    examiner = Examiner(asked, validation_courses(asked), FIRST_SEED)
    episodes = [one for lot in examiner.park(decide).values() for one in lot]
    examiner.close()
    tally = ParkingTally.of(episodes)
    barred = [one for one in episodes if one["between"]]
    barred_parked = sum(one["is_success"] for one in barred)
    parked = sum(one["is_success"] for one in episodes)
    vehicles = settings.race.learners
    teams = TeamTally.of(episodes, vehicles) if vehicles > 1 else None
    of_teams = ("rounds", "all_parked", "contacts", "stuck")
    return {
        "starts": tally.episodes,
        "parked": parked,
        "aligned": round(tally.aligned_rate * tally.episodes),
        **{name: tally.failures.get(name, 0) for name in FAILURES},
        "walked_into": tally.walked_into,
        # Starts where something stands between vehicle and slot, and the others.
        "barred": len(barred),
        "barred_parked": barred_parked,
        "open": len(episodes) - len(barred),
        "open_parked": parked - barred_parked,
        "return": fmean(one["r"] for one in episodes),
        "length": fmean(one["l"] for one in episodes),
        "time_s": tally.time_s_median,
        "path_m": tally.path_m_median,
        "direction_changes": tally.direction_changes_mean,
        **({} if teams is None else {name: getattr(teams, name) for name in of_teams}),
    }
