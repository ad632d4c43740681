"""Motion of all karts and what happens where bodies meet."""

import math

from race_server.core import codes
from race_server.core.clock import SUBSTEP_S
from race_server.core.kernels.contacts import box_on_box, box_on_segment, impulse, touching_point
from race_server.core.kernels.geometry import cos_sin, wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.motion import move
from race_server.core.rules.conduct import is_new_touch, is_ramming
from race_server.core.rules.effects import surface_roll
from race_server.core.stages.events import report, retire
from race_server.core.state import Record, World

# A touch softer than this closing speed [m/s] is no event.
TOUCH_SPEED = 0.2


@kernel
def move_karts(world: World, w: int) -> None:
    """Move every kart by one substep."""
    for k in range(world.bodies.shape[1]):
        body, vehicle = world.bodies[w, k], world.vehicles[w, k]
        if body.status == codes.ABSENT or body.trust != codes.SIMULATED:
            continue
        throttle, brake = body.throttle, body.brake
        if body.status != codes.RACING:
            throttle, brake = 0.0, 1.0
        moved = move(
            vehicle,
            body.x,
            body.y,
            body.heading,
            body.speed,
            body.lateral_speed,
            body.yaw_rate,
            body.steering,
            body.steering_command,
            throttle,
            brake,
            body.speed_cap,
            body.thrust_scale,
            body.grip_scale,
            surface_roll(body.surface),
            SUBSTEP_S,
        )
        body.x, body.y = moved[0], moved[1]
        body.heading = wrap_angle(moved[2])
        body.speed, body.lateral_speed, body.yaw_rate = moved[3], moved[4], moved[5]
        body.steering = moved[6]


@kernel
def touch_walls(world: World, w: int) -> None:
    """Let karts meet borders and obstacles."""
    site = world.walls.sites[world.rules[w].course]
    for k in range(world.bodies.shape[1]):
        body, vehicle = world.bodies[w, k], world.vehicles[w, k]
        if body.trust >= codes.DOUBTFUL:
            continue
        if body.status == codes.RACING or body.status == codes.FINISHED:
            if not _is_clear(world, site, body, vehicle):
                _touch_near_walls(world, w, k, site)


@kernel
def _is_clear(world: World, site: Record, body: Record, vehicle: Record) -> bool:
    """Return whether the place of a kart alone shows that it touches no wall.

    First as a disc around the whole body, then as two, one around either half.
    """
    quarter, half_width = 0.25 * vehicle.length, 0.5 * vehicle.width
    whole = 2.0 * quarter + abs(vehicle.box_offset)
    if _is_disc_clear(world, site, body.x, body.y, whole * whole + half_width * half_width):
        return True
    cos, sin = cos_sin(body.heading)
    square = quarter * quarter + half_width * half_width
    front, rear = vehicle.box_offset + quarter, vehicle.box_offset - quarter
    return _is_disc_clear(
        world, site, body.x + front * cos, body.y + front * sin, square
    ) and _is_disc_clear(world, site, body.x + rear * cos, body.y + rear * sin, square)


@kernel
def _is_disc_clear(world: World, site: Record, x: float, y: float, square: float) -> bool:
    """Return whether no wall comes near a place, by the square of the distance [m²]."""
    column = math.floor((x - site.x0) / site.cell)
    row = math.floor((y - site.y0) / site.cell)
    if column < 0 or row < 0 or column >= site.columns or row >= site.rows:
        return True
    clear = float(world.walls.cell_clear[site.cell_start + row * site.columns + column])
    return bool(clear * clear >= square)


@kernel
def _touch_near_walls(world: World, w: int, k: int, site: Record) -> None:
    body, vehicle = world.bodies[w, k], world.vehicles[w, k]
    half_length, half_width = 0.5 * vehicle.length, 0.5 * vehicle.width
    cos, sin = cos_sin(body.heading)
    reach_x = half_length * abs(cos) + half_width * abs(sin)
    reach_y = half_length * abs(sin) + half_width * abs(cos)
    x, y = body.x + vehicle.box_offset * cos, body.y + vehicle.box_offset * sin
    scale = 1.0 / site.cell
    first_column = max(math.floor((x - reach_x - site.x0) * scale), 0)
    last_column = min(math.floor((x + reach_x - site.x0) * scale), site.columns - 1)
    first_row = max(math.floor((y - reach_y - site.y0) * scale), 0)
    last_row = min(math.floor((y + reach_y - site.y0) * scale), site.rows - 1)
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            cell = site.cell_start + row * site.columns + column
            for entry in range(world.walls.cell_first[cell], world.walls.cell_first[cell + 1]):
                wall = site.wall_start + world.walls.cell_walls[entry]
                depth, nx, ny = box_on_segment(
                    body.x + vehicle.box_offset * cos,
                    body.y + vehicle.box_offset * sin,
                    cos,
                    sin,
                    half_length,
                    half_width,
                    world.walls.segments[wall, 0],
                    world.walls.segments[wall, 1],
                    world.walls.segments[wall, 2],
                    world.walls.segments[wall, 3],
                )
                if depth > 0.0:
                    _meet_wall(world, w, k, depth, nx, ny, cos, sin)


@kernel
def _meet_wall(
    world: World, w: int, k: int, depth: float, nx: float, ny: float, cos: float, sin: float
) -> None:
    body, racer = world.bodies[w, k], world.racers[w, k]
    vehicle, rules = world.vehicles[w, k], world.rules[w]
    # A real kart is where it is: its touch counts, but no blow moves it.
    is_free = body.trust == codes.SIMULATED
    if is_free:
        body.x += depth * nx
        body.y += depth * ny
    px, py = touching_point(cos, sin, 0.5 * vehicle.length, 0.5 * vehicle.width, nx, ny)
    px, py = px + vehicle.box_offset * cos, py + vehicle.box_offset * sin
    vx, vy = _velocity_at(body, cos, sin, px, py)
    closing, sliding = vx * nx + vy * ny, vy * nx - vx * ny
    lever_n, lever_t = px * ny - py * nx, px * nx + py * ny
    mass_n = 1.0 / (1.0 / vehicle.mass + lever_n * lever_n / vehicle.yaw_inertia)
    mass_t = 1.0 / (1.0 / vehicle.mass + lever_t * lever_t / vehicle.yaw_inertia)
    normal, tangent = impulse(
        closing, sliding, mass_n, mass_t, rules.restitution, rules.wall_friction
    )
    if normal <= 0.0:
        return
    jx, jy = normal * nx - tangent * ny, normal * ny + tangent * nx
    if is_free:
        _push(body, vehicle, cos, sin, px, py, jx, jy)
    tick = world.races[w].tick
    if closing < -TOUCH_SPEED and body.status == codes.RACING:
        if is_new_touch(tick, racer.contact_wall_tick, racer.wall_contacts):
            racer.contact_wall_tick = tick
            racer.wall_contacts += 1
            racer.lap_clean = 0
            report(world, w, codes.EVENT_CONTACT_WALL, k, -1, round(normal * 1000.0))
    if rules.wall_contact == codes.RETIRE:
        retire(world, w, k, codes.CRASH)


@kernel
def _velocity_at(body: Record, cos: float, sin: float, px: float, py: float) -> tuple[float, float]:
    """Return the velocity [m/s] in the world of the body's point (px, py) from its centre."""
    vx = body.speed * cos - body.lateral_speed * sin - body.yaw_rate * py
    vy = body.speed * sin + body.lateral_speed * cos + body.yaw_rate * px
    return vx, vy


@kernel
def _push(
    body: Record,
    vehicle: Record,
    cos: float,
    sin: float,
    px: float,
    py: float,
    jx: float,
    jy: float,
) -> None:
    """Give a kart the impulse (jx, jy) [N s] at the point (px, py) from its centre."""
    body.speed += (jx * cos + jy * sin) / vehicle.mass
    body.lateral_speed += (jy * cos - jx * sin) / vehicle.mass
    body.yaw_rate += (px * jy - py * jx) / vehicle.yaw_inertia


@kernel
def _is_solid(world: World, w: int, k: int) -> bool:
    body = world.bodies[w, k]
    if body.status != codes.RACING or body.trust >= codes.DOUBTFUL:
        return False
    return bool(world.races[w].tick >= body.ghost_until)


@kernel
def find_contact_pairs(world: World, w: int) -> None:
    """Note for every kart, as bits, which of those after it may meet it within this tick."""
    karts = world.bodies.shape[1]
    for k in range(karts):
        body = world.bodies[w, k]
        size = world.vehicles[w, k].length
        company = 0
        for other in range(k + 1, karts):
            dx, dy = world.bodies[w, other].x - body.x, world.bodies[w, other].y - body.y
            # Bodies further apart than the sum of their lengths cannot touch; twice that leaves
            # room for what both drive in a tick: no kart drives its own length in 1/60 s.
            near = 2.0 * (size + world.vehicles[w, other].length)
            if dx * dx + dy * dy < near * near:
                company |= 1 << (other - k - 1)
        body.company = company


@kernel
def touch_karts(world: World, w: int) -> None:
    """Let karts meet each other."""
    if world.rules[w].kart_contact == codes.GHOST:
        return
    karts = world.bodies.shape[1]
    for k in range(karts):
        company = world.bodies[w, k].company
        if company == 0 or not _is_solid(world, w, k):
            continue
        size = world.vehicles[w, k].length
        for other in range(k + 1, karts):
            if not company >> (other - k - 1) & 1 or not _is_solid(world, w, other):
                continue
            # Half a body's diagonal and its offset are less than its length.
            dx = world.bodies[w, other].x - world.bodies[w, k].x
            dy = world.bodies[w, other].y - world.bodies[w, k].y
            near = size + world.vehicles[w, other].length
            if dx * dx + dy * dy < near * near:
                _meet_kart(world, w, k, other)


@kernel
def _meet_kart(world: World, w: int, k: int, other: int) -> None:
    a_body, a_racer = world.bodies[w, k], world.racers[w, k]
    b_body, b_racer = world.bodies[w, other], world.racers[w, other]
    va, vb = world.vehicles[w, k], world.vehicles[w, other]
    ca, sa = cos_sin(a_body.heading)
    cb, sb = cos_sin(b_body.heading)
    depth, nx, ny = box_on_box(
        a_body.x + va.box_offset * ca,
        a_body.y + va.box_offset * sa,
        ca,
        sa,
        0.5 * va.length,
        0.5 * va.width,
        b_body.x + vb.box_offset * cb,
        b_body.y + vb.box_offset * sb,
        cb,
        sb,
        0.5 * vb.length,
        0.5 * vb.width,
    )
    if depth <= 0.0:
        return
    # Real karts stand like walls; what two of them would do to each other is reported alone.
    a_moves, b_moves = a_body.trust == codes.SIMULATED, b_body.trust == codes.SIMULATED
    a_counts = 1.0 if a_moves or not b_moves else 0.0
    b_counts = 1.0 if b_moves or not a_moves else 0.0
    share = vb.mass / (va.mass + vb.mass)
    if not (a_moves and b_moves):
        share = 1.0 if a_moves else 0.0
    depth = depth if a_moves or b_moves else 0.0
    a_body.x += share * depth * nx
    a_body.y += share * depth * ny
    b_body.x -= (1.0 - share) * depth * nx
    b_body.y -= (1.0 - share) * depth * ny
    # The blow acts in the middle between the two points that lie deepest.
    ax, ay = touching_point(ca, sa, 0.5 * va.length, 0.5 * va.width, nx, ny)
    bx, by = touching_point(cb, sb, 0.5 * vb.length, 0.5 * vb.width, -nx, -ny)
    mx = 0.5 * (a_body.x + va.box_offset * ca + ax + b_body.x + vb.box_offset * cb + bx)
    my = 0.5 * (a_body.y + va.box_offset * sa + ay + b_body.y + vb.box_offset * sb + by)
    ax, ay, bx, by = mx - a_body.x, my - a_body.y, mx - b_body.x, my - b_body.y
    vax, vay = _velocity_at(a_body, ca, sa, ax, ay)
    vbx, vby = _velocity_at(b_body, cb, sb, bx, by)
    closing = (vax - vbx) * nx + (vay - vby) * ny
    sliding = (vay - vby) * nx - (vax - vbx) * ny
    inverse = a_counts / va.mass + b_counts / vb.mass
    na, ta, nb, tb = ax * ny - ay * nx, ax * nx + ay * ny, bx * ny - by * nx, bx * nx + by * ny
    ia, ib = va.yaw_inertia, vb.yaw_inertia
    mass_n = 1.0 / (inverse + a_counts * na * na / ia + b_counts * nb * nb / ib)
    mass_t = 1.0 / (inverse + a_counts * ta * ta / ia + b_counts * tb * tb / ib)
    rules = world.rules[w]
    normal, tangent = impulse(
        closing, sliding, mass_n, mass_t, rules.restitution, rules.wall_friction
    )
    if normal <= 0.0:
        return
    jx, jy = normal * nx - tangent * ny, normal * ny + tangent * nx
    if a_moves:
        _push(a_body, va, ca, sa, ax, ay, jx, jy)
    if b_moves:
        _push(b_body, vb, cb, sb, bx, by, -jx, -jy)
    tick = world.races[w].tick
    if closing < -TOUCH_SPEED and is_new_touch(tick, a_racer.contact_kart_tick, a_racer.contacts):
        a_racer.contact_kart_tick = tick
        b_racer.contact_kart_tick = tick
        a_racer.contacts += 1
        b_racer.contacts += 1
        report(world, w, codes.EVENT_CONTACT_KART, k, other, round(normal * 1000.0))
        if rules.ram_speed > 0.0:
            _judge_blow(world, w, k, other, nx, ny, -(vax * nx + vay * ny), -closing)
            _judge_blow(world, w, other, k, -nx, -ny, vbx * nx + vby * ny, -closing)
    if rules.kart_contact == codes.RETIRE:
        retire(world, w, k, codes.CRASH)
        retire(world, w, other, codes.CRASH)


@kernel
def _judge_blow(
    world: World, w: int, k: int, other: int, nx: float, ny: float, approach: float, closing: float
) -> None:
    """Warn, and in the end remove, a kart that drove into another; the normal points to it."""
    body, racer, hit = world.bodies[w, k], world.racers[w, k], world.bodies[w, other]
    cos, sin = math.cos(hit.heading), math.sin(hit.heading)
    c, s = math.cos(body.heading), math.sin(body.heading)
    front = world.vehicles[w, k].box_offset + 0.5 * world.vehicles[w, k].length
    dx, dy = body.x + front * c - hit.x, body.y + front * s - hit.y
    nose = dx * cos + dy * sin - world.vehicles[w, other].box_offset
    rules = world.rules[w]
    if not is_ramming(-(nx * c + ny * s), nose, closing, approach, rules.ram_speed):
        return
    racer.warnings += 1
    report(world, w, codes.EVENT_WARNING, k, other, racer.warnings)
    if 0 < rules.ram_warnings <= racer.warnings:
        retire(world, w, k, codes.RAMMING)
