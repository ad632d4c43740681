"""Effects on a kart: what they leave of speed, motor and grip, and when they end."""

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.state import EFFECTS, Record

# On kerbs and grass: grip as a share of that on asphalt, and extra rolling resistance as a share
# of the weight. Our choice; grass should cost far more than it can win.
KERB_GRIP, KERB_ROLL = 0.9, 0.02
GRASS_GRIP, GRASS_ROLL = 0.5, 0.15


@kernel
def surface_at(offset: float, left: float, right: float, kerb: float) -> int:
    """Return the surface at a lateral offset.

    offset: to the left of the centre line [m]; left, right: half-widths of the asphalt [m]; kerb:
    width of the kerb beside it [m].
    """
    beyond = offset - left if offset > 0.0 else -offset - right
    if beyond <= 0.0:
        return codes.ASPHALT
    return codes.KERB if beyond <= kerb else codes.GRASS


@kernel
def surface_grip(surface: int) -> float:
    """Return the grip of a surface as a share of that on asphalt."""
    if surface == codes.ASPHALT:
        return 1.0
    return KERB_GRIP if surface == codes.KERB else GRASS_GRIP


@kernel
def surface_roll(surface: int) -> float:
    """Return the extra rolling resistance of a surface as a share of the weight."""
    if surface == codes.ASPHALT:
        return 0.0
    return KERB_ROLL if surface == codes.KERB else GRASS_ROLL


@kernel
def add_effect(player: Record, item: Record, number: int, tick: int) -> None:
    """Put an item's effect on a kart; the same effect again only lasts longer.

    player: PLAYER; item: ITEM; number: of the item; tick: now. Where all places are taken, the
    effect that would end first makes room.
    """
    place = 0
    for index in range(EFFECTS):
        if player.effects[index].source == number:
            place = index
            break
        if player.effects[index].until_tick < player.effects[place].until_tick:
            place = index
    effect = player.effects[place]
    effect.source = number
    effect.until_tick = tick + item.effect_ticks
    effect.speed_scale = item.speed_scale
    effect.thrust_scale = item.thrust_scale
    effect.grip_scale = item.grip_scale


@kernel
def is_harmless(player: Record, tick: int) -> bool:
    """Return whether a shield or the immunity after an effect protects a kart."""
    return tick < player.shield_until or tick < player.immune_until


@kernel
def sum_effects(player: Record) -> tuple[float, float, float]:
    """Return the product of all effects: of top speed, of motor force, of grip."""
    speed, thrust, grip = 1.0, 1.0, 1.0
    for index in range(EFFECTS):
        effect = player.effects[index]
        if effect.source > 0:
            speed *= effect.speed_scale
            thrust *= effect.thrust_scale
            grip *= effect.grip_scale
    return speed, thrust, grip
