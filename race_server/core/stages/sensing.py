"""After the tick: what the sensors of each kart give, at their own rates."""

from race_server.core import codes
from race_server.core.kernels.boxes import box_count, hull_of
from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rng import LIDAR_STREAM, RADAR_STREAM
from race_server.core.kernels.sensors import cast_fan, disturb, see_body, see_disc
from race_server.core.kernels.wall_scan import FEW_RAYS, scan_body
from race_server.core.state import HAZARDS, Bytes, Float32s, Floats, World


@large_kernel
def sense(world: World, w: int) -> None:
    """Take the scans that are due at this tick."""
    sensors, tick = world.sensors[0], world.races[w].tick
    lidar_due = tick % sensors.lidar_period_ticks == 0
    radar_due = tick % sensors.radar_period_ticks == 0
    if not lidar_due and not radar_due:
        return
    for k in range(world.bodies.shape[1]):
        body = world.bodies[w, k]
        if body.status == codes.ABSENT:
            continue
        if lidar_due and body.sensors & codes.LIDAR:
            for ray in range(len(world.sight.lidar_rays)):
                world.sight.lidar[w, k, 1, ray] = world.sight.lidar[w, k, 0, ray]
            scan_lidar(world, w, k)
        if radar_due and body.sensors & codes.RADAR:
            scan_radar(world, w, k)


@large_kernel
def sense_first(world: World, w: int, k: int) -> None:
    """Give one kart its first scans; the scan before is the same."""
    if world.bodies[w, k].sensors & codes.LIDAR:
        scan_lidar(world, w, k)
        for ray in range(world.sight.lidar.shape[3]):
            world.sight.lidar[w, k, 1, ray] = world.sight.lidar[w, k, 0, ray]
    if world.bodies[w, k].sensors & codes.RADAR:
        scan_radar(world, w, k)


@kernel
def scan_lidar(world: World, w: int, k: int) -> None:
    """Take one lidar scan of one kart."""
    sensors, race = world.sensors[0], world.races[w]
    ranges = world.sight.lidar[w, k, 0]
    _scan(
        world,
        w,
        k,
        sensors.lidar_ahead,
        world.sight.lidar_rays,
        sensors.lidar_field,
        sensors.lidar_reach,
        ranges,
        world.sight.radar_kinds[w, k, :0],  # nobody asks a lidar for kinds
    )
    disturb(
        ranges,
        sensors.lidar_reach,
        sensors.lidar_noise,
        sensors.lidar_dropout,
        race.seed,
        LIDAR_STREAM,
        race.tick,
        k,
    )


@kernel
def scan_radar(world: World, w: int, k: int) -> None:
    """Take one radar reading of one kart."""
    sensors, race = world.sensors[0], world.races[w]
    ranges = world.sight.radar[w, k]
    _scan(
        world,
        w,
        k,
        sensors.radar_ahead,
        world.sight.radar_rays,
        sensors.radar_field,
        sensors.radar_reach,
        ranges,
        world.sight.radar_kinds[w, k],
    )
    disturb(
        ranges, sensors.radar_reach, sensors.radar_noise, 0.0, race.seed, RADAR_STREAM, race.tick, k
    )


@kernel
def _scan(
    world: World,
    w: int,
    k: int,
    mount: float,
    rays: Floats,
    field: float,
    reach: float,
    ranges: Float32s,
    kinds: Bytes,
) -> None:
    """Fill ranges and kinds of a fan mounted `mount` [m] ahead of the centre of gravity."""
    body = world.bodies[w, k]
    site = world.walls.sites[world.rules[w].course]
    cos, sin = cos_sin(body.heading)
    x, y = body.x + mount * cos, body.y + mount * sin
    cast_fan(world.walls, site, x, y, cos, sin, rays, field, reach, ranges, kinds)
    for other in range(world.bodies.shape[1]):
        rival = world.bodies[w, other]
        if other == k or rival.status != codes.RACING or rival.trust >= codes.SUSPENDED:
            continue
        vehicle = world.vehicles[w, other]
        for number in range(box_count(vehicle)):
            hull = hull_of(vehicle, rival, number)
            if len(rays) > FEW_RAYS and len(kinds) == 0:
                scan_body(
                    x,
                    y,
                    cos,
                    sin,
                    rays,
                    field,
                    reach,
                    hull.x,
                    hull.y,
                    hull.heading,
                    hull.offset,
                    hull.half_length,
                    hull.half_width,
                    ranges,
                )
                continue
            see_body(
                x,
                y,
                cos,
                sin,
                rays,
                reach,
                hull.x,
                hull.y,
                hull.heading,
                hull.offset,
                hull.half_length,
                hull.half_width,
                codes.KART_HIT,
                ranges,
                kinds,
            )
    tick = world.races[w].tick
    for index in range(HAZARDS):
        hazard = world.hazards[w, index]
        if tick < hazard.until_tick:
            see_disc(
                x,
                y,
                cos,
                sin,
                rays,
                reach,
                hazard.x,
                hazard.y,
                hazard.radius,
                codes.HAZARD_HIT,
                ranges,
                kinds,
            )
