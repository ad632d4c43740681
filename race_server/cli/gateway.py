"""`race gateway`: lets browsers watch, drive and steward a race."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_server.cli.access import Connect, KeysFolder, SessionName
from race_server.cli.document import AsJson, print_document

if TYPE_CHECKING:
    from race_server.live.gateway.settings import Addresses, Settings

OPEN, TOKEN = "open", "token"


def gateway(
    connect: Connect = "",
    session: SessionName = "",
    keys: KeysFolder = None,
    listen: Annotated[str, typer.Option(help="Where browsers connect: HOST:PORT.")] = "",
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Another port; 0 for any that is free.")
    ] = None,
    is_open: Annotated[
        bool, typer.Option("--open", help="Let browsers of other machines in: those with tokens.")
    ] = False,
    spectators: Annotated[
        str, typer.Option(help="open: anybody may watch. token: only who has the address.")
    ] = "",
    drivers: Annotated[
        int, typer.Option(min=0, max=64, help="So many seats may be driven from browsers.")
    ] = 0,
    steward: Annotated[
        bool, typer.Option("--steward", help="Let a browser do what `race admin` does.")
    ] = False,
    recordings: Annotated[
        str,
        typer.Option(
            help="Folder whose recordings may be watched, or none; without it that of the server."
        ),
    ] = "",
    origin: Annotated[
        list[str] | None,
        typer.Option(help="Another page that may connect, such as https://race.example."),
    ] = None,
    certificate: Annotated[
        Path | None, typer.Option(help="Certificate for https (PEM), with --key.")
    ] = None,
    private_key: Annotated[
        Path | None, typer.Option("--key", help="Its private key (PEM).")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="End when the race has gone.")] = False,
    log_json: Annotated[
        bool, typer.Option("--log-json", help="Log JSON lines, even to a terminal.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Let browsers watch a race, drive seats of it and steward it, from a process of its own."""
    # Before any kernel is imported: a gateway steps no world and needs no compiler.
    os.environ["RACE_SERVER_INTERPRET"] = "1"
    from race_server.cli.access import SESSION
    from race_server.errors import KeysError
    from race_server.live.gateway.key_ring import KeyRing
    from race_server.live.gateway.service import Gateway
    from race_server.live.gateway.settings import (
        DEFAULT_PLACE,
        Settings,
        check_settings,
        place_of,
        tokens_for,
    )
    from race_server.logs import Log
    from race_server.net.transport import DEFAULT_ADDRESS
    from race_server.storage.recording.logbook import folder_of

    if spectators not in {"", OPEN, TOKEN}:
        raise KeysError(f"--spectators {spectators}: choose {OPEN} or {TOKEN}")
    ring = KeyRing(keys, session)
    held = ring.of_spectator()
    host, chosen = place_of(listen or DEFAULT_PLACE)
    settings = Settings(
        address=connect or (held.address if held else DEFAULT_ADDRESS),
        session=held.session if held else session or SESSION,
        ring=ring,
        host=host,
        port=chosen if port is None else port,
        tokens=tokens_for(
            drivers=drivers,
            steward=steward,
            open_to_all=spectators == OPEN or not (spectators or is_open),
        ),
        recordings=folder_of(recordings),
        origins=tuple(origin or ()),
        certificate=certificate,
        private_key=private_key,
        once=once,
    )
    check_settings(settings, is_open=is_open)
    if steward:
        ring.of_steward()
    with Log(as_json=log_json) as log:
        served = Gateway(settings, log)
        _tell(served.addresses, settings, as_json=as_json)
        served.run()


def _tell(addresses: "Addresses", settings: "Settings", *, as_json: bool) -> None:
    """Say what people are to open."""
    from dataclasses import asdict

    if as_json:
        print_document({**asdict(addresses), "race": settings.address, "session": settings.session})
        return
    rows = [("watch", addresses.watch)]
    rows += [("drive", address) for address in addresses.drive]
    rows += [("steward", addresses.steward)] if addresses.steward else []
    for what, address in rows:
        print(f"{what:8} {address}", flush=True)
    if not settings.is_local and settings.certificate is None:
        print(
            "anybody on the way can read these tokens: use --certificate and --key, or put a "
            "reverse proxy with TLS in front (docs/gateway.md)",
            flush=True,
        )
