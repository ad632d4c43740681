"""Shield: takes whatever hits the kart for a few seconds."""

from race_server.core.rules.items.item import Item, Use

ITEM = Item(
    name="shield",
    use=Use.GUARD,
    leader_weight=2.0,
    last_weight=1.0,
    effect_s=6.0,
)
