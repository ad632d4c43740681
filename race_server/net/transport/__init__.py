"""The links over zenoh; no other package uses it.

The server's session is the router: it listens on one address, with scouting, gossip and shared
memory off; `net.auth` has the access rules. Callbacks only put bytes into bounded mailboxes, one
for each key, so that no client displaces messages of others; the server's loop empties them. Real
karts are peers of one another, without a router. An open session keeps its process alive, so all
ends are context managers and are closed at exit as well.
"""

from race_server.net.transport.client import ClientLink
from race_server.net.transport.link import DEFAULT_ADDRESS, open_session
from race_server.net.transport.mailbox import Mailbox
from race_server.net.transport.peer import PeerLink
from race_server.net.transport.server import Request, ServerLink

__all__ = [
    "DEFAULT_ADDRESS",
    "ClientLink",
    "Mailbox",
    "PeerLink",
    "Request",
    "ServerLink",
    "open_session",
]
