"""Figures of rounds in which several vehicles park: whether all of them did, and what kept them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from race_server.competition.parking_tally import COLLISIONS, LATE
from race_server.competition.proportion import wilson_interval


@dataclass(frozen=True)
class TeamTally:
    """Figures of rounds; each is one team."""

    vehicles: int  # of a team
    rounds: int
    all_parked: int  # rounds in which every vehicle parked
    all_parked_interval: tuple[float, float]  # bounds of 95 % of their share
    contacts: int  # rounds in which a vehicle ran into something
    stuck: int  # rounds without a contact in which a vehicle ran out of time: waiting, or too slow
    last_s_mean: float | None  # time until the last had parked, of rounds in which all did

    @property
    def all_parked_rate(self) -> float:
        """Share of the rounds in which every vehicle parked."""
        return self.all_parked / max(self.rounds, 1)

    @staticmethod
    def of(episodes: Sequence[Mapping[str, Any]], vehicles: int) -> "TeamTally":
        """Return the figures of episodes, those of a round behind one another."""
        rounds = [episodes[at : at + vehicles] for at in range(0, len(episodes), vehicles)]
        whole = [team for team in rounds if all(one["is_success"] for one in team)]
        touched = [any(one["ending"] in COLLISIONS for one in team) for team in rounds]
        late = [any(one["ending"] == LATE for one in team) for team in rounds]
        last = [max(float(one["time_s"]) for one in team) for team in whole]
        return TeamTally(
            vehicles=vehicles,
            rounds=len(rounds),
            all_parked=len(whole),
            all_parked_interval=wilson_interval(len(whole), len(rounds)),
            contacts=sum(touched),
            stuck=sum(is_late and not met for is_late, met in zip(late, touched, strict=True)),
            last_s_mean=sum(last) / len(last) if last else None,
        )
