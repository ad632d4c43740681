"""After the tick: the scans of each kart's sensors, each at its own rate."""

from race_server.core import codes
from race_server.core.kernels.boxes import Hull, box_count, hull_of
from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rays import Fan
from race_server.core.kernels.rng import LIDAR_STREAM, RADAR_STREAM
from race_server.core.kernels.sensors import cast_fan, disturb, see_body, see_disc
from race_server.core.kernels.wall_scan import FEW_RAYS, scan_body
from race_server.core.stages.blocks import block_hull, is_near_block, is_own_block
from race_server.core.stages.sightings import note_sightings
from race_server.core.state import HAZARDS, Bytes, Float32s, Record, World


@kernel
def sense(world: World, w: int) -> None:
    """Take the scans that are due at this tick."""
    sensors, tick, carried = world.sensors[0], world.races[w].tick, 0
    for k in range(world.bodies.shape[1]):
        carried |= world.bodies[w, k].sensors
    # A division costs as much as the rest of a tick's bookkeeping, so it comes last.
    lidar_due = carried & codes.LIDAR != 0 and tick % sensors.lidar_period_ticks == 0
    radar_due = carried & codes.RADAR != 0 and tick % sensors.radar_period_ticks == 0
    if lidar_due or radar_due:
        _scan_all(world, w, lidar_due, radar_due)


@large_kernel
def _scan_all(world: World, w: int, lidar_due: bool, radar_due: bool) -> None:
    """Take the scans of every kart's sensors that are due."""
    for k in range(world.bodies.shape[1]):
        body = world.bodies[w, k]
        if body.status == codes.ABSENT:
            continue
        if lidar_due and body.sensors & codes.LIDAR:
            for ray in range(len(world.sight.lidar_rays)):
                world.sight.lidar[w, k, 1, ray] = world.sight.lidar[w, k, 0, ray]
            scan_lidar(world, w, k)
        if radar_due and body.sensors & codes.RADAR:
            for ray in range(len(world.sight.radar_rays)):
                world.sight.radar_before[w, k, ray] = world.sight.radar[w, k, ray]
            scan_radar(world, w, k)


@large_kernel
def sense_first(world: World, w: int, k: int) -> None:
    """Take the first scans of one kart; they also stand for the scan before."""
    if world.bodies[w, k].sensors & codes.LIDAR:
        scan_lidar(world, w, k)
        for ray in range(world.sight.lidar.shape[3]):
            world.sight.lidar[w, k, 1, ray] = world.sight.lidar[w, k, 0, ray]
    if world.bodies[w, k].sensors & codes.RADAR:
        scan_radar(world, w, k)
        for ray in range(len(world.sight.radar_rays)):
            world.sight.radar_before[w, k, ray] = world.sight.radar[w, k, ray]


@kernel
def scan_lidar(world: World, w: int, k: int) -> None:
    """Take one lidar scan of one kart."""
    sensors, race, rays = world.sensors[0], world.races[w], world.sight.lidar_rays
    ranges = world.sight.lidar[w, k, 0]
    x, y, cos, sin = _pose_of(world.bodies[w, k], sensors.lidar_ahead)
    fan = Fan(x, y, cos, sin, rays, sensors.lidar_field, sensors.lidar_reach)
    _scan(world, w, k, fan, ranges, world.sight.radar_kinds[w, k, :0])  # a lidar has no kinds
    noise, dropout = sensors.lidar_noise, sensors.lidar_dropout
    place = world.racers[w, k].grid_place
    disturb(ranges, fan.reach, noise, dropout, race.seed, LIDAR_STREAM, race.tick, place)
    note_sightings(world, w, k, fan, ranges)


@kernel
def scan_radar(world: World, w: int, k: int) -> None:
    """Take one radar reading of one kart."""
    sensors, race, rays = world.sensors[0], world.races[w], world.sight.radar_rays
    ranges = world.sight.radar[w, k]
    x, y, cos, sin = _pose_of(world.bodies[w, k], sensors.radar_ahead)
    fan = Fan(x, y, cos, sin, rays, sensors.radar_field, sensors.radar_reach)
    _scan(world, w, k, fan, ranges, world.sight.radar_kinds[w, k])
    place, noise = world.racers[w, k].grid_place, sensors.radar_noise
    disturb(ranges, fan.reach, noise, 0.0, race.seed, RADAR_STREAM, race.tick, place)
    note_sightings(world, w, k, fan, ranges)


@kernel
def _pose_of(body: Record, mount: float) -> tuple[float, float, float, float]:
    """Return place [m] and direction of a sensor `mount` [m] ahead of the centre of gravity."""
    cos, sin = cos_sin(body.heading)
    return body.x + mount * cos, body.y + mount * sin, cos, sin


@kernel
def _scan(world: World, w: int, k: int, fan: Fan, ranges: Float32s, kinds: Bytes) -> None:
    """Fill ranges (R,) [m] and kinds (R,) of a fan of kart k; `kinds` may be empty."""
    site = world.walls.sites[world.rules[w].course]
    cast_fan(world.walls, site, fan, ranges, kinds)
    for other in range(world.bodies.shape[1]):
        rival = world.bodies[w, other]
        if other == k or rival.status != codes.RACING or rival.trust >= codes.SUSPENDED:
            continue
        vehicle = world.vehicles[w, other]
        for number in range(box_count(vehicle)):
            _see(fan, hull_of(vehicle, rival, number), codes.KART_HIT, ranges, kinds)
    blocks = world.parking.blocks[w]
    for number in range(len(blocks)):
        block = blocks[number]
        if not is_near_block(block, fan.x, fan.y, fan.reach):
            continue
        if not is_own_block(world.vehicles[w, k], k, world.bodies.shape[1], number):
            _see(fan, block_hull(block), block.kind, ranges, kinds)
    for walker in world.parking.walkers[w]:
        if walker.radius > 0.0:
            see_disc(fan, walker.x, walker.y, walker.radius, codes.PERSON, ranges, kinds)
    tick = world.races[w].tick
    for index in range(HAZARDS):
        hazard = world.hazards[w, index]
        if tick < hazard.until_tick:
            see_disc(fan, hazard.x, hazard.y, hazard.radius, codes.HAZARD_HIT, ranges, kinds)


@kernel
def _see(fan: Fan, hull: Hull, kind: int, ranges: Float32s, kinds: Bytes) -> None:
    """Shorten the rays that meet a box of a given kind; ranges, kinds: see `_scan`."""
    if len(fan.rays) > FEW_RAYS and len(kinds) == 0:
        scan_body(fan, hull, ranges)
    else:
        see_body(fan, hull, kind, ranges, kinds)
