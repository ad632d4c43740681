"""`race drill`: provoke failures and attacks, and check that races survive them."""

import json
from typing import Annotated, Any

import typer
from rich.table import Table

from race_server.cli.document import AsJson
from race_server.cli.drill_page import page
from race_server.cli.drill_report import finish, progress, show_drills
from race_server.cli.options import Track, known_drivers
from race_server.terminal import Console

app = typer.Typer(
    help="Provoke failures and attacks in a live race, and check that the race survives them."
)
app.command()(page)

Seed = Annotated[int, typer.Option(help="Seed of all random draws.")]


@app.command()
def crash(
    times: Annotated[int, typer.Option(min=1, help="Number of times to kill the server.")] = 10,
    laps: Annotated[int, typer.Option(min=1, help="Laps to the finish of each race.")] = 6,
    real: Annotated[
        int,
        typer.Option(min=0, max=4, help="Number of the eight karts that are played as real ones."),
    ] = 0,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Kill the server of a race of eight; check that the race continues and no lap is lost."""
    with progress("killing the server", times) as tell:
        from race_server.tools.drills.crash import drill_crash

        document = drill_crash(times, laps=laps, real=real, seed=seed, tell=tell)
    finish(document, as_json=as_json)


@app.command()
def park(
    lot: Annotated[str, typer.Option(help="Car park: a name from `race lot list`.")] = "kart-park",
    seats: Annotated[int, typer.Option(min=1, max=64, help="Number of vehicles.")] = 20,
    vehicle: Annotated[
        str, typer.Option(help="Vehicle. Default: the one that the car park is made for.")
    ] = "",
    driver: Annotated[
        str, typer.Option(help="Driver that parks them, such as valet or learned:NAME.")
    ] = "valet",
    together: Annotated[
        int, typer.Option(min=1, help="Vehicles that are on their way at a time.")
    ] = 64,
    seed: Seed = 1,
    kill: Annotated[
        bool, typer.Option("--kill/--no-kill", help="Kill the server half way.")
    ] = True,
    real: Annotated[
        int, typer.Option(min=0, help="Number of vehicles that are real karts (plants).")
    ] = 0,
    as_json: AsJson = False,
) -> None:
    """Have vehicles of a running session parked on command; kill the server half way.

    All must be parked, no person hit, and the recording driven again must be the same session.
    """
    with progress("parking", seats) as tell:
        from race_server.tools.drills.park import drill_park

        known_drivers(driver)
        settings: dict[str, Any] = {"vehicle": vehicle, "driver": driver, "together": together}
        settings |= {"seed": seed, "kill": kill, "real": real}
        document = drill_park(lot, seats=seats, tell=tell, **settings)
    finish(document, as_json=as_json)


@app.command()
def deny(as_json: AsJson = False) -> None:
    """Try every forbidden act against an open session, and check that legal acts still work."""
    from race_server.tools.drills.deny import drill_deny

    with Console(stderr=True).status("trying forbidden acts", spinner="dots"):
        document = drill_deny()
    finish(document, as_json=as_json)


@app.command()
def hostile(
    messages: Annotated[
        int, typer.Option(min=1000, help="Number of messages to send and decode.")
    ] = 20_000,
    rate: Annotated[int, typer.Option(min=1, help="Messages per second.")] = 5000,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Decode damaged and crafted messages, then send them to a race of eight.

    Every decoder takes its share: those of server, clients, gateway, recordings and results.
    """
    from race_server.tools.drills.hostile import drill_hostile

    with progress("sending", messages) as tell:
        document = drill_hostile(messages, rate=rate, seed=seed, tell=tell)
    if not as_json:
        table = Table(*(name.replace("_", " ") for name in document["decoders"][0]))
        for row in document["decoders"]:
            table.add_row(*map(str, row.values()))
        Console().print(table)
    finish(document, as_json=as_json)


@app.command()
def files(as_json: AsJson = False) -> None:
    """Read small files that claim gigabytes, and check that each is refused at little cost."""
    from race_server.tools.drills.bombs import BOMBS
    from race_server.tools.drills.files import drill_files

    with progress("reading", len(BOMBS)) as tell:
        document = drill_files(tell)
    finish(document, as_json=as_json)


@app.command()
def output(as_json: AsJson = False) -> None:
    """Race with names that are markup or formulas, and with a disk that takes nothing."""
    from race_server.tools.drills.output import drill_output

    with progress("racing", 3) as tell:
        document = drill_output(tell)
    finish(document, as_json=as_json)


@app.command()
def hang(as_json: AsJson = False) -> None:
    """Let a driver hang as a process and inside the server; check that the race goes on."""
    from race_server.tools.drills.hang import drill_hang

    with progress("hanging", 3) as tell:
        document = drill_hang(tell)
    finish(document, as_json=as_json)


@app.command()
def flood(
    junk: Annotated[int, typer.Option(min=10, help="Connections without keys a second.")] = 200,
    seconds: Annotated[float, typer.Option(min=3.0, help="Seconds of each attack.")] = 8.0,
    as_json: AsJson = False,
) -> None:
    """Flood a racing server with connections; check that clients with keys still log in."""
    from race_server.tools.drills.flood import ATTACKS, drill_flood

    with progress("flooding", len(ATTACKS)) as tell:
        document = drill_flood(junk, seconds, tell=tell)
    finish(document, as_json=as_json, rows="attacks")


@app.command()
def network(
    loss: Annotated[
        float, typer.Option(min=0.0, max=0.9, help="Share of packets lost, 0 to 0.9.")
    ] = 0.2,
    delay: Annotated[
        float, typer.Option(min=0.0, help="Delay of each packet, one way [ms].")
    ] = 100.0,
    jitter: Annotated[
        float, typer.Option(min=0.0, help="Largest deviation from --delay [ms].")
    ] = 50.0,
    track: Track = "oval-report",
    laps: Annotated[int, typer.Option(min=1, help="Laps to the finish.")] = 3,
    drivers: Annotated[
        str, typer.Option(help="Comma-separated drivers, repeated until all 8 seats are filled.")
    ] = "pure_pursuit,follow_gap,avoider",
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Race over a network that loses, delays and reorders packets both ways; requires root."""
    from race_server.tools.drills.lossy_link import LinkConditions
    from race_server.tools.drills.network import DRIVERS, drill_network

    names = known_drivers(drivers) or DRIVERS
    conditions = LinkConditions(loss, delay / 1e3, jitter / 1e3)
    with progress("racing", None) as tell:
        document = drill_network(
            conditions, track=track, laps=laps, drivers=names, seed=seed, tell=tell
        )
    finish(document, as_json=as_json, rows="drivers")


@app.command()
def sites(
    delay: Annotated[
        float, typer.Option(min=0.0, help="Delay of each packet, one way [ms].")
    ] = 20.0,
    jitter: Annotated[
        float, typer.Option(min=0.0, help="Largest deviation from --delay [ms].")
    ] = 5.0,
    loss: Annotated[
        float, typer.Option(min=0.0, max=0.9, help="Share of packets lost, 0 to 0.9.")
    ] = 0.0,
    laps: Annotated[int, typer.Option(min=1, help="Laps to the finish.")] = 2,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Race four karts of two sites against each other over a slow network; requires root."""
    from race_server.tools.drills.lossy_link import LinkConditions
    from race_server.tools.drills.sites import drill_sites

    conditions = LinkConditions(loss, delay / 1e3, jitter / 1e3)
    with progress("racing", None) as tell:
        document = drill_sites(conditions, laps=laps, seed=seed, tell=tell)
    finish(document, as_json=as_json, rows="karts")


@app.command()
def load(
    karts: Annotated[int, typer.Option(min=1, max=64, help="Number of karts.")] = 64,
    spectators: Annotated[int, typer.Option(min=1, help="Number of spectators.")] = 200,
    minutes: Annotated[
        float,
        typer.Option(min=0.05, max=14.0, help="Minutes of racing on each of the two servers."),
    ] = 1.0,
    as_json: AsJson = False,
) -> None:
    """Load a server with karts and spectators; then the same over websockets and JSON."""
    from race_server.tools.drills.load import drill_load

    with progress("racing", round(2 * 60 * minutes)) as tell:
        document = drill_load(karts, spectators, minutes, tell=tell)
    finish(document, as_json=as_json, columns=("race_server", "websockets_orjson"))


@app.command()
def mixed(
    track: Track = "hangar-400",
    vehicle: Annotated[str, typer.Option(help="Vehicle: tt02, kart-30 or kart-60.")] = "kart-30",
    karts: Annotated[
        int, typer.Option(min=2, max=64, help="Number of karts; two are played as real ones.")
    ] = 8,
    laps: Annotated[int, typer.Option(min=1, help="Laps to the finish.")] = 2,
    seed: Seed = 1,
    pedestrian: Annotated[
        float, typer.Option(help="Time at which a pedestrian steps in front of a real kart [s].")
    ] = 12.0,
    cut_link: Annotated[
        float, typer.Option(help="Time at which a real kart loses its radio link [s].")
    ] = 110.0,
    delay_ms: Annotated[
        float, typer.Option(help="Delay of each message of a real kart, each way [ms].")
    ] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Race two real karts (plants) among simulated ones, with a pedestrian and a cut link."""
    from race_server.tools.drills.mixed import MixedRaceSetting, drill_mixed

    setting = MixedRaceSetting(track, vehicle, karts, laps, seed, pedestrian, cut_link, delay_ms)
    document = drill_mixed(setting, Console(stderr=True))
    if not as_json:
        Console().print_json(json.dumps(document["figures"]))
    finish(document, as_json=as_json)


@app.command()
def kart(
    pause: Annotated[
        float, typer.Option(min=1.0, max=600.0, help="Time for which the race is paused [s].")
    ] = 12.0,
    as_json: AsJson = False,
) -> None:
    """Let the link of a real kart (a plant) stall and come back; then pause its race."""
    with progress("racing", round(40 + pause)) as tell:
        from race_server.tools.drills.kart import drill_kart

        document = drill_kart(pause, tell=tell)
    finish(document, as_json=as_json)


@app.command()
def power(
    cuts: Annotated[
        int, typer.Option(min=1, help="Number of cuts of each of the two files.")
    ] = 100,
    kills: Annotated[
        int, typer.Option(min=1, help="Number of times to kill a process that writes them.")
    ] = 100,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Cut a recording and a results file at random bytes, and read what is left of a race."""
    with progress("cutting", 2 * cuts + kills) as tell:
        from race_server.tools.drills.power import drill_power

        document = drill_power(cuts, kills, seed=seed, tell=tell)
    finish(document, as_json=as_json)


@app.command()
def readonly(as_json: AsJson = False) -> None:
    """Serve where recordings, results or the steward's token cannot be written."""
    with Console(stderr=True).status("serving", spinner="dots"):
        from race_server.tools.drills.readonly import drill_readonly

        document = drill_readonly()
    finish(document, as_json=as_json)


@app.command()
def soak(
    minutes: Annotated[float, typer.Option(min=0.2, help="Minutes of racing.")] = 60.0,
    karts: Annotated[int, typer.Option(min=1, max=64, help="Number of karts.")] = 32,
    spectators: Annotated[int, typer.Option(min=1, help="Number of spectators.")] = 100,
    as_json: AsJson = False,
) -> None:
    """Race after race before spectators; see whether the server grows in memory or files."""
    with progress("racing", round(60 * minutes)) as tell:
        from race_server.tools.drills.soak import drill_soak

        document = drill_soak(minutes, karts, spectators, tell=tell)
    finish(document, as_json=as_json)


@app.command("all")
def every(as_json: AsJson = False) -> None:
    """Run every drill at a small size, one after the other."""
    with progress("preparing", None) as bar:
        from race_server.tools.drills.small import run_all, small_drills

        bar(0)
        sizes = small_drills()
    total = sum(small.seconds for small in sizes.values())
    with progress(f"running {len(sizes)} drills", round(total)) as tell:
        document = run_all(sizes, tell=tell)
    if not as_json:
        show_drills(document["drills"])
    finish(document, as_json=as_json)
