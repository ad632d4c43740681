"""The table of results at the end of a race."""

from typing import Any

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Flag, Phase, Standing
from race_server.live.client.leaderboard import Headline, leaderboard
from race_server.terminal import Console


def show_result(document: dict[str, Any], track: str, laps: int, session: str) -> None:
    """Print the table of results."""
    rows = [Standing.of_json(kart) for kart in document["karts"]]
    console = Console()
    headline = Headline(session, track, laps, Phase.FINISHED, Flag.GREEN)
    console.print(leaderboard(headline, rows))
    seconds = document["ticks"] / TICKS_PER_SECOND
    missed = document["missed_ticks"]
    console.print(
        f"{seconds:.1f} s of racing, {len(document['events'])} events, {missed} missed ticks, "
        f"digest {document['digest']}",
        style="dim",
    )
