"""Boost: more motor and a higher top speed for a short while."""

from race_server.core.rules.items.item import Item, Use

ITEM = Item(
    name="boost",
    use=Use.ON_SELF,
    leader_weight=1.0,
    last_weight=3.0,
    effect_s=2.0,
    speed_scale=1.25,
    thrust_scale=1.6,
)
