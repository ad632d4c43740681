"""Several races in a row, after which the drivers are rated."""

import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from statistics import fmean, stdev
from typing import Any

from rich.table import Table

from race_server.competition.launch import RaceSpec
from race_server.storage.results.ratings import ratings

Document = dict[str, Any]


def orders_of(drivers: Sequence[str], races: int, seed: int) -> Iterator[tuple[str, ...]]:
    """Return the drivers of each race, the first on pole.

    In as many races as there are karts every driver starts once from each place; then a new order
    is drawn, so that neighbours change.
    """
    chance, order = random.Random(seed), list(drivers)
    for number in range(races):
        turn = number % len(order)
        if turn == 0:
            chance.shuffle(order)
        yield (*order[turn:], *order[:turn])


def plans_of(plan: RaceSpec, races: int, seed: int) -> Iterator[RaceSpec]:
    """Return the plan of each race: seeds from `seed` on, and a different order on the grid."""
    for number, drivers in enumerate(orders_of(plan.drivers, races, seed)):
        # Of two seeds on a command line the last one counts.
        yield replace(plan, drivers=drivers, serve=(*plan.serve, "--seed", str(seed + number)))


def run_series(
    plan: RaceSpec, races: int, seed: int, run: Callable[[RaceSpec, int], Document]
) -> Document:
    """Run the races and return their documents, with the ratings of all drivers.

    run: runs one race, given its plan and its number from 0. One that is stopped counts
    no more, and no other follows.

    Raises:
        RaceError: a race ends without a result.
    """
    documents: list[Document] = []
    stopped = False
    for number, one in enumerate(plans_of(plan, races, seed)):
        document = run(one, number)
        if stopped := document["stopped"]:
            break
        documents.append(document)
    return {"races": documents, "ratings": rated(documents), "stopped": stopped}


def rated(documents: list[Document]) -> list[Document]:
    """Return rating, interval, mean place with its standard error, and wins, the best first.

    Over a few races the mean place separates drivers whose rating intervals overlap.
    """
    orders = [[(kart["driver"], kart["rank"]) for kart in one["karts"]] for one in documents]
    rows = []
    for rating in ratings(orders):
        own = [k for one in documents for k in one["karts"] if k["driver"] == rating.driver]
        places = [fmean(ranks) for one in orders if (ranks := _ranks(one, rating.driver))]
        rows.append(
            {
                **asdict(rating),
                "mean_place": fmean(places),
                "place_error": stdev(places) / math.sqrt(len(places)) if len(places) > 1 else 0.0,
                "wins": sum(kart["rank"] == 1 for kart in own),
                "starts": len(own),
            }
        )
    return sorted(rows, key=lambda row: -row["mu"])


def _ranks(order: list[tuple[str, int]], driver: str) -> list[int]:
    return [rank for name, rank in order if name == driver]


def rating_table(rows: list[Document], races: int) -> Table:
    """Return the ratings as a table."""
    title = f"{races} races, Plackett-Luce, 95 % intervals"
    table = Table("driver", title=title, title_justify="left")
    for column in ("rating", "from", "to", "mean place", "wins", "starts"):
        table.add_column(column, justify="right")
    for row in rows:
        figures = (f"{row[name]:.0f}" for name in ("mu", "low", "high"))
        place = f"{row['mean_place']:.2f} ± {row['place_error']:.2f}"
        table.add_row(row["driver"], *figures, place, str(row["wins"]), str(row["starts"]))
    return table
