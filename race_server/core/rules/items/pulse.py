"""Pulse: slows the next kart ahead that races on, wherever it is."""

from race_server.core.rules.items.item import Item, Use

ITEM = Item(
    name="pulse",
    use=Use.ON_KART_AHEAD,
    leader_weight=0.5,
    last_weight=2.0,
    effect_s=1.5,
    speed_scale=0.5,
    thrust_scale=0.5,
    immunity_s=2.0,
)
