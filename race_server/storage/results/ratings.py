"""How strong drivers are, from the order in which they finished."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean

from race_server.errors import ResultsError


@dataclass(frozen=True)
class Rating:
    """The strength of a driver: `mu` ± `sigma`; `ordinal` is what it is at least, mu - 3 sigma."""

    driver: str
    mu: float
    sigma: float
    ordinal: float
    races: int


def ratings(races: Iterable[Sequence[tuple[str, int]]]) -> list[Rating]:
    """Return the ratings after races in order, the strongest first.

    A race is a driver and a rank for each kart. A driver with several karts in a race counts
    once, by the mean of their ranks; a race of one driver says nothing.

    Raises:
        ResultsError: openskill is not installed.
    """
    try:
        from openskill.models import PlackettLuce, PlackettLuceRating
    except ImportError as error:
        raise ResultsError(
            "ratings need openskill, from the extra `results`: pip install 'race-server[results]'"
        ) from error
    model = PlackettLuce()
    strengths: dict[str, PlackettLuceRating] = {}
    counts: dict[str, int] = {}
    for race in races:
        places = _places(race)
        if len(places) < 2:
            continue
        teams = [[strengths.get(driver) or model.rating(name=driver)] for driver in places]
        rated = model.rate(teams, ranks=list(places.values()))
        for driver, team in zip(places, rated, strict=True):
            strengths[driver] = team[0]
            counts[driver] = counts.get(driver, 0) + 1
    found = [
        Rating(driver, rating.mu, rating.sigma, rating.ordinal(), counts[driver])
        for driver, rating in strengths.items()
    ]
    return sorted(found, key=lambda rating: (-rating.ordinal, rating.driver))


def _places(race: Sequence[tuple[str, int]]) -> dict[str, float]:
    """Return the mean rank of each driver of a race."""
    ranks: dict[str, list[int]] = {}
    for driver, rank in race:
        ranks.setdefault(driver, []).append(rank)
    return {driver: fmean(of_driver) for driver, of_driver in ranks.items()}
