"""`race plant`: a simulated stand-in for a real kart."""

import math
import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from race_server.cli.access import Connect, KeysFolder, SessionName, access
from race_server.core.seeds import MOST_SEED
from race_server.kept_file import check_place


def plant(
    driver: Annotated[str, typer.Option(help="Installed driver of the kart.")] = ("pure_pursuit"),
    valet: Annotated[
        str, typer.Option(help="Driver that parks the kart when the server orders that.")
    ] = "valet",
    on_request: Annotated[
        bool,
        typer.Option(
            "--on-request",
            help="In a car park: stand until the server orders the kart to park.",
        ),
    ] = False,
    connect: Connect = "",
    session: SessionName = "",
    keys: KeysFolder = None,
    seat: Annotated[
        int, typer.Option(help="Number of the seat to take; -1: any, or the one in the keys.")
    ] = -1,
    patience: Annotated[float, typer.Option(help="Seconds to wait for the server.")] = 20.0,
    deviation: Annotated[
        float, typer.Option(help="Standard deviation of the position fixes [m], ten a second.")
    ] = 0.02,
    fix_delay_ms: Annotated[
        float, typer.Option(min=0.0, max=600.0, help="Delay of the position fixes [ms].")
    ] = 100.0,
    unstamped: Annotated[
        bool, typer.Option("--unstamped", help="Fixes do not say when they were taken.")
    ] = False,
    wheels_lock: Annotated[
        float, typer.Option(min=0.0, help="Share of the brakes above which wheels lock.")
    ] = math.inf,
    radar_errs: Annotated[
        bool,
        typer.Option(
            "--radar-errs", help="A radar with stray, missing, mirrored and confused echoes."
        ),
    ] = False,
    delay_ms: Annotated[float, typer.Option(help="Delay of every message, each way [ms].")] = 0.0,
    pedestrian: Annotated[
        float | None,
        typer.Option(
            help="Time at which a pedestrian steps in front of the kart [s]. Default: none."
        ),
    ] = None,
    cut_link: Annotated[
        float | None, typer.Option(help="Time at which the radio link is lost [s]. Default: never.")
    ] = None,
    kill_game: Annotated[
        float | None,
        typer.Option(
            "--kill-game-at",
            min=0.0,
            help="Speed [km/h] at which the program beside the safety side is killed, by itself. "
            "Default: never.",
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(min=0, max=MOST_SEED, help="Seed of the kart as built and of its sensors."),
    ] = 1,
    beside: Annotated[
        str,
        typer.Option(
            help="Tell programs on this machine what the kart knows, at this address, such as "
            "tcp/127.0.0.1:7450, for `race gateway --kart`. Default: none."
        ),
    ] = "",
    peers_at: Annotated[
        str,
        typer.Option(
            help="Listen for other real karts at this address, such as tcp/127.0.0.1:7460, or "
            "tls/192.168.1.21:7460 with --keys. Default: tell and hear none."
        ),
    ] = "",
    peer: Annotated[
        list[str] | None,
        typer.Option(help="Address of another real kart's --peers-at. Once for each of them."),
    ] = None,
    assistance: Annotated[
        Literal["none", "brakes", "pedals"],
        typer.Option(
            help="Help for a racing driver: none, the kart brakes for bends, or it accelerates too."
        ),
    ] = "none",
    report: Annotated[
        Path | None, typer.Option(help="Write a report on the kart to this JSON file.")
    ] = None,
    black_box: Annotated[
        Path | None,
        typer.Option("--black-box", help="Keep each turn of the safety side in this MCAP file."),
    ] = None,
    only_incidents: Annotated[
        bool,
        typer.Option(
            "--only-incidents",
            help="With --black-box: keep only what was before and after the kart braked by itself "
            "or felt a blow, 60 s and 10 s.",
        ),
    ] = False,
) -> None:
    """Play a real kart: its own physics, sensors and control unit, tracked by the server."""
    if report is not None:
        check_place(report)
    # Set before any kernel is imported: one kart needs no compiler.
    os.environ["RACE_SERVER_INTERPRET"] = "1"
    from race_agents.plant.radar import ERRS, PERFECT
    from race_agents.plant.run import PlantSetting, run_plant
    from race_agents.plant.sensors import Sensors
    from race_server.coaching.assistance import Level

    if peer and not peers_at:
        raise typer.BadParameter("--peer needs --peers-at, where this kart listens")
    given = access(keys, connect, session)
    setting = PlantSetting(
        driver=driver,
        valet=valet,
        on_request=on_request,
        seat=given.seat(seat),
        address=given.address,
        session=given.session,
        keys=given.keys,
        patience_s=patience,
        delay_s=delay_ms / 1000.0,
        sensors=Sensors(
            fix_deviation=deviation,
            fix_delay_s=fix_delay_ms / 1000.0,
            fix_stamped=not unstamped,
            wheels_lock=wheels_lock,
            radar=ERRS if radar_errs else PERFECT,
        ),
        seed=seed,
        pedestrian_s=pedestrian,
        cut_s=cut_link,
        kill_at=None if kill_game is None else kill_game / 3.6,
        beside=beside,
        peers=(peers_at, *(peer or ())) if peers_at else (),
        level=Level[assistance.upper()],
        report=report,
        black_box=black_box,
        only_incidents=only_incidents,
    )
    run_plant(setting)
