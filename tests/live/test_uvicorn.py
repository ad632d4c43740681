"""The gateway subclasses protocols of uvicorn that are no public API: tests that they are there."""

import hashlib
import inspect
import re

import pytest
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from race_server.live.gateway.connection import (
    USED_OF_HTTP,
    USED_OF_WEBSOCKET,
    PendingConnection,
    WebSocketConnection,
)

# Digests of the sources that `race_server/live/gateway/connection.py` was written against.
READ = {WebSocketsSansIOProtocol: "0bbcec98938432f7", H11Protocol: "c2573d455fed4ec2"}


def digest_of(protocol: type) -> str:
    return hashlib.sha256(inspect.getsource(protocol).encode()).hexdigest()[:16]


@pytest.mark.parametrize("protocol", READ, ids=lambda protocol: protocol.__name__)
def test_uvicorn_still_has_the_protocols_that_the_gateway_was_written_against(
    protocol: type,
) -> None:
    assert digest_of(protocol) == READ[protocol], (
        f"uvicorn {uvicorn.__version__} has another {protocol.__name__} than the one that "
        "race_server/live/gateway/connection.py was written against. Read what changed in the "
        "methods that are overridden there and in the names under USED_OF_…, run "
        "tests/live/test_gateway.py, then put the new digest here: "
        f"{digest_of(protocol)}. Until then install the uvicorn of constraints.txt."
    )


@pytest.mark.parametrize(
    ("ours", "theirs", "used"),
    [
        (WebSocketConnection, WebSocketsSansIOProtocol, USED_OF_WEBSOCKET),
        (PendingConnection, H11Protocol, USED_OF_HTTP),
    ],
    ids=["websocket", "http"],
)
def test_every_name_that_the_gateway_takes_from_uvicorn_is_declared_and_there(
    ours: type, theirs: type, used: tuple[str, ...]
) -> None:
    names_there = {*re.findall(r"self\.(\w+)", inspect.getsource(theirs)), *vars(theirs)}
    assert set(used) <= names_there
    names = {*re.findall(r"self\.(\w+)", inspect.getsource(ours)), *vars(ours)}
    private = {name for name in names if name.startswith("_") and not name.endswith("__")}
    assert not private & names_there  # ours would overwrite what uvicorn keeps there
    taken = set(re.findall(r"self\.(\w+)", inspect.getsource(ours))) - private - set(vars(ours))
    assert taken == set(used)
    overridden = set(re.findall(r"super\(\)\.(\w+)", inspect.getsource(ours)))
    assert overridden <= set(dir(theirs))
