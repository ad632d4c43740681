"""Oil: a puddle left behind; it slows karts that drive into it and reduces their grip."""

from race_server.core.rules.items.item import Item, Use

ITEM = Item(
    name="oil",
    use=Use.PLACED,
    leader_weight=3.0,
    last_weight=1.0,
    effect_s=1.5,
    speed_scale=0.4,
    thrust_scale=0.5,
    grip_scale=0.7,
    immunity_s=2.0,
    radius=0.6,
    life_s=30.0,
    owner_grace_s=3.0,
)
