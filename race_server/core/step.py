"""One tick of the world, in order.

`advance_world` is the only way time passes. The live server, the time trial and the replay call
it through `advance`, one compiled call for any number of worlds and ticks; the training world's
compiled decision calls it for each world, between reading actions and computing rewards.
"""

from race_server.core import codes
from race_server.core.clock import SUBSTEPS
from race_server.core.kernels.jit import kernel, large_kernel, written_out
from race_server.core.stages.allowances import set_allowances
from race_server.core.stages.blocks import forget_rooms
from race_server.core.stages.contacts import find_contact_pairs
from race_server.core.stages.controls import take_controls
from race_server.core.stages.events import report, retire
from race_server.core.stages.hitches import watch_hitches
from race_server.core.stages.items import end_effects, use_items
from race_server.core.stages.judging import touch_karts, touch_walls
from race_server.core.stages.motion import move_bodies
from race_server.core.stages.parking import park
from race_server.core.stages.people import walk
from race_server.core.stages.pick_ups import pick_up_items
from race_server.core.stages.placement import place
from race_server.core.stages.progress import follow_course, has_line
from race_server.core.stages.sensing import sense
from race_server.core.stages.standings import close_race, rank
from race_server.core.stages.stewarding import steward
from race_server.core.state import Floats, World

# After a red flag the karts are held for this time before they race on.
RESTART_TICKS = 180


@kernel
def advance(world: World, controls: Floats, ticks: int) -> None:
    """Move every world on by `ticks` ticks under the same controls.

    controls: (W, K, 4) steering [-1, 1], throttle [-1, 1], brake [0, 1], buttons.
    """
    for w in range(world.bodies.shape[0]):
        advance_world(world, w, controls[w], ticks)


@large_kernel
def advance_world(world: World, w: int, controls: Floats, ticks: int) -> None:
    """Move one world on by `ticks` ticks under the same controls, shape (K, 4).

    A call that hands over the whole world costs as much as moving a kart: one for all ticks.
    """
    take_controls(world.bodies[w], controls)
    forget_rooms(world.parking.rooms[w])
    for _ in range(ticks):
        step(world, w)


@written_out
def step(world: World, w: int) -> None:
    """Move one world on by one tick."""
    race, bodies, vehicles = world.races[w], world.bodies[w], world.vehicles[w]
    if race.tick == race.start_tick:
        report(world, w, codes.EVENT_GREEN, -1, -1, 0)
    end_effects(world, w)
    set_allowances(world, w)
    use_items(world, w)
    find_contact_pairs(bodies, vehicles, world.turns[w])
    walk(world, w)
    for _ in range(SUBSTEPS):
        move_bodies(bodies, vehicles)
        touch_karts(world, w)
        touch_walls(world, w)
    watch_hitches(world, w)
    if has_line(world, w):
        follow_course(world, w)
        steward(world, w)
        pick_up_items(world, w)
    park(world, w)
    rank(world, w)
    close_race(world, w)
    race.tick += 1
    sense(world, w)


@kernel
def show_flag(world: World, w: int, flag: int) -> None:
    """Show a flag to all karts of one world. After red they stand for three more seconds."""
    race = world.races[w]
    if race.flag == flag:
        return
    if race.flag == codes.RED:
        race.hold_until = race.tick + RESTART_TICKS
    race.flag = flag
    report(world, w, codes.EVENT_FLAG, -1, flag, 0)


@kernel
def withdraw(world: World, w: int, kart: int) -> None:
    """Take a kart out of its race because it lost its driver."""
    retire(world, w, kart, codes.WITHDREW)


@kernel
def remove(world: World, w: int, kart: int, fault: int) -> None:
    """Take a kart out of its race because the stewards decided so. fault: Fault."""
    event = world.event_counts[w]
    retire(world, w, kart, codes.REMOVED)
    if event < world.event_counts[w]:
        world.events[w, event].value = fault


@kernel
def place_karts(world: World, w: int, placements: Floats) -> None:
    """Put real karts where they are, before a tick. placements: (n, 10), see state.PLACEMENT."""
    for row in range(placements.shape[0]):
        place(world, w, placements[row])
