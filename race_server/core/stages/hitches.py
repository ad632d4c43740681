"""Jack-knives: hitches that are bent too far, and trailers that touch what draws them."""

from race_server.core import codes
from race_server.core.kernels.boxes import box_count, box_of, hull_of
from race_server.core.kernels.contacts import box_on_box
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.trailers import hitch_angle
from race_server.core.stages.events import retire
from race_server.core.state import Record, World


@kernel
def watch_hitches(world: World, w: int) -> None:
    """Retire every vehicle whose trailers stand as they must not, in a race as in a car park."""
    for k in range(world.bodies.shape[1]):
        if world.vehicles[w, k].trailer_count > 0 and world.bodies[w, k].status == codes.RACING:
            _judge_hitches(world, w, k)


@large_kernel
def _judge_hitches(world: World, w: int, k: int) -> None:
    """Retire a vehicle beyond the limit of a hitch, or with two boxes in one place."""
    body, vehicle = world.bodies[w, k], world.vehicles[w, k]
    for number in range(vehicle.trailer_count):
        if abs(hitch_angle(body, number)) > vehicle.trailers[number].limit:
            retire(world, w, k, codes.JACK_KNIFE)
            return
    for one in range(box_count(vehicle) - 1):
        for two in range(one + 1, box_count(vehicle)):
            if two == one + 1 and lies_on(vehicle, one):
                continue
            front, rear = hull_of(vehicle, body, one), hull_of(vehicle, body, two)
            if box_on_box(box_of(front), box_of(rear))[0] > 0.0:
                retire(world, w, k, codes.OWN_BODY)
                return


@kernel
def lies_on(vehicle: Record, number: int) -> bool:
    """Return whether a trailer reaches over what draws it, as a semitrailer does.

    vehicle: VEHICLE; number: of the trailer, from 0. Then the limit of its hitch alone counts.
    """
    behind = 0.5 * vehicle.length - vehicle.box_offset - vehicle.rear_axle
    if number > 0:
        behind = vehicle.trailers[number - 1].behind
    drawn = vehicle.trailers[number]
    return bool(drawn.hitch - drawn.ahead < behind)
