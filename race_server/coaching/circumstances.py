"""Which laps say something about their driver, and which about others, flags and items."""

from dataclasses import dataclass

# A kart this close ahead [s] decides how fast one is.
TRAFFIC_S = 1.0
# Less than this [s] in traffic or under a yellow flag costs a lap nothing worth mentioning.
BRIEFLY_S = 0.5


@dataclass(frozen=True)
class Circumstances:
    """What happened in a lap besides driving."""

    is_flying: bool  # False: from standstill
    is_clean: bool  # no wall, no short cut, no rescue, not off the course
    contacts: int = 0  # with karts
    hits: int = 0  # by items
    effect_s: float = 0.0  # under an effect of an item: used on itself, or of a hit before the lap
    caution_s: float = 0.0  # under a yellow or red flag
    traffic_s: float = 0.0  # with a kart less than TRAFFIC_S ahead

    @property
    def reason(self) -> str:
        """Why the lap is not compared; empty where it is."""
        reasons = (
            (not self.is_flying, "from the start"),
            (not self.is_clean, "not clean"),
            (self.contacts > 0, "touched a kart"),
            (self.hits > 0, "hit by an item"),
            (self.effect_s > 0.0, f"{self.effect_s:.1f} s under an item's effect"),
            (self.caution_s > BRIEFLY_S, f"{self.caution_s:.1f} s under a flag"),
            (self.traffic_s > BRIEFLY_S, f"{self.traffic_s:.1f} s in traffic"),
        )
        return ", ".join(words for holds, words in reasons if holds)
