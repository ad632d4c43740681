"""Report on an articulated vehicle: three ways to use a heuristic."""

from race_agents.reproductions.plan import Variant
from race_agents.reproductions.report_c import SAC_ASSUMPTION, table_of

_WORDS = {
    "difference": "d(s) - d(s'), as printed",
    "potential": "not tried",
    "hurl": "not tried",
}


def _row(heuristic: str, shaping: str) -> Variant:
    changes = (f"parking.heuristic={heuristic}", f"parking.shaping={shaping}")
    return Variant(f"{heuristic}, {shaping}", changes, theirs=(_WORDS[shaping],))


REPRODUCTION = table_of(
    "A lorry learns to park: a heuristic as a difference, as a potential, and in the targets",
    *(_row(name, way) for name in ("euclid", "bfs", "hybrid") for way in _WORDS),
    finding="the difference alone",
    assumptions=(
        SAC_ASSUMPTION,
        "The potential is that of Ng, Harada and Russell (1999), 0 at the end of an episode: it "
        "leaves the best policy as it is. The report's difference is this potential and a penalty "
        "of (1 - gamma) d(s') for each decision besides.",
        "HuRL: Cheng, Kolobov and Swaminathan (NeurIPS 2021). Its heuristic is a return: 100 after "
        "the way at 1 m/s, and 20 for the time until then, spread evenly over an episode.",
    ),
)
