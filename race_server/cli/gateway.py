"""`race gateway`: lets browsers watch, drive and steward a race."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_server.cli.access import Connect, KeysFolder, SessionName
from race_server.cli.document import print_document
from race_server.cli.option_fields import expand_options
from race_server.errors import KeysError
from race_server.terminal import say

if TYPE_CHECKING:
    from race_server.live.gateway.settings import Addresses, Settings

OPEN, TOKEN = "open", "token"


@dataclass(frozen=True)
class GatewayOptions:
    """All options of `race gateway`."""

    connect: Connect = ""
    session: SessionName = ""
    keys: KeysFolder = None
    listen: Annotated[
        str,
        typer.Option(help="HOST:PORT on which browsers connect. Default: 127.0.0.1:8080."),
    ] = ""
    port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Listen on this port instead of the one in --listen; 0: any free port.",
        ),
    ] = None
    is_open: Annotated[
        bool,
        typer.Option("--open", help="Accept browsers with a token from other machines."),
    ] = False
    spectators: Annotated[
        str,
        typer.Option(
            help="open: all browsers may watch. token: only browsers with the printed address. "
            "Default: open, with --open token."
        ),
    ] = ""
    browsers: Annotated[
        int,
        typer.Option(
            min=1, max=2048, help="Number of browsers at a time; more are told that it is full."
        ),
    ] = 512
    drivers: Annotated[
        int,
        typer.Option(min=0, max=64, help="Number of seats that browsers may drive."),
    ] = 0
    steward: Annotated[
        bool, typer.Option("--steward", help="Let a browser steward the race, as `race admin`.")
    ] = False
    companion: Annotated[
        list[int] | None,
        typer.Option(
            min=0,
            max=63,
            help="Let a browser beside the driver of this seat, such as that of a real kart, see "
            "what the driver must see; may be repeated.",
        ),
    ] = None
    kart: Annotated[
        str,
        typer.Option(
            help="Address at which a kart's program on this machine tells what it knows "
            "(`race plant --beside`); browsers beside its driver see that without a server, too."
        ),
    ] = ""
    recordings: Annotated[
        str,
        typer.Option(
            help="Folder of recordings that browsers may watch, or none. Default: the folder that "
            "`race serve` records to."
        ),
    ] = ""
    origin: Annotated[
        list[str] | None,
        typer.Option(
            help="Origin of another page that may connect, such as https://race.example; may be "
            "repeated."
        ),
    ] = None
    certificate: Annotated[
        Path | None, typer.Option(help="Certificate for https (PEM file); requires --key.")
    ] = None
    private_key: Annotated[
        Path | None, typer.Option("--key", help="Private key of the certificate (PEM file).")
    ] = None
    once: Annotated[bool, typer.Option("--once", help="Exit when the session ends.")] = False
    log_json: Annotated[
        bool, typer.Option("--log-json", help="Log JSON lines, even to a terminal.")
    ] = False
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the addresses as one JSON document.")
    ] = False


@expand_options
def gateway(options: GatewayOptions) -> None:
    """Let browsers watch a race, drive seats of it and steward it."""
    # Set before any kernel is imported: a gateway steps no world and needs no compiler.
    os.environ["RACE_SERVER_INTERPRET"] = "1"
    from race_server.live.gateway.service import Gateway
    from race_server.logs import Log

    settings = _settings(options)
    with Log(as_json=options.log_json) as log:
        served = Gateway(settings, log)
        _print_addresses(served.addresses, settings, as_json=options.as_json)
        served.run()


def _settings(options: GatewayOptions) -> "Settings":
    """Return the settings of a gateway.

    Raises:
        KeysError: the keys do not fit what browsers are to do.
        LinkError: an address is not valid, or open to other machines by mistake.
    """
    from race_server.cli.access import SESSION
    from race_server.live.gateway.key_ring import KeyRing
    from race_server.live.gateway.limits import GatewayLimits
    from race_server.live.gateway.settings import (
        DEFAULT_PLACE,
        Settings,
        check_settings,
        place_of,
        tokens_for,
    )
    from race_server.net.transport import DEFAULT_ADDRESS
    from race_server.storage.recording.logbook import folder_of

    if options.spectators not in {"", OPEN, TOKEN}:
        raise KeysError(f"--spectators {options.spectators}: choose {OPEN} or {TOKEN}")
    if options.kart and not options.companion:
        raise KeysError(f"--kart {options.kart}: name the seat of the kart with --companion SEAT")
    ring = KeyRing(options.keys, options.session)
    held = ring.of_spectator()
    host, port = place_of(options.listen or DEFAULT_PLACE)
    settings = Settings(
        address=options.connect or (held.address if held else DEFAULT_ADDRESS),
        session=held.session if held else options.session or SESSION,
        ring=ring,
        kart=options.kart,
        host=host,
        port=port if options.port is None else options.port,
        tokens=tokens_for(
            drivers=options.drivers,
            steward=options.steward,
            companions=options.companion or (),
            open_to_all=options.spectators == OPEN or not (options.spectators or options.is_open),
        ),
        recordings=folder_of(options.recordings),
        origins=tuple(options.origin or ()),
        certificate=options.certificate,
        private_key=options.private_key,
        once=options.once,
        limits=GatewayLimits(browsers=options.browsers),
    )
    check_settings(settings, is_open=options.is_open)
    if options.steward:
        ring.of_steward()
    for seat, _ in settings.tokens.companion:
        ring.of_seat(seat)
    return settings


def _print_addresses(addresses: "Addresses", settings: "Settings", *, as_json: bool) -> None:
    """Print the addresses that people open."""
    from dataclasses import asdict

    if as_json:
        print_document({**asdict(addresses), "race": settings.address, "session": settings.session})
        return
    rows = [("watch", addresses.watch)]
    rows += [("drive", address) for address in addresses.drive]
    rows += [("steward", addresses.steward)] if addresses.steward else []
    rows += [("beside", address) for address in addresses.companion]
    for what, address in rows:
        say(f"{what:8} {address}")
    if not settings.is_local and settings.certificate is None:
        say(
            "these tokens are sent in the clear: use --certificate and --key, or put a "
            "reverse proxy with TLS in front (docs/gateway.md)"
        )
