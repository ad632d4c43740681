"""zenoh, and nothing else that knows it.

The server's session is the router: it listens on one address, with scouting, gossip and shared
memory off; `admission` says who may do what there. Callbacks do no more than put bytes into bounded
mailboxes, one for each key, so that no sender crowds others out; the server's loop empties them. A
session that is not closed keeps its process alive, so both ends are context managers and are closed
at exit as well.
"""

from race_server.net.transport.client import ClientLink
from race_server.net.transport.link import DEFAULT_ADDRESS, open_session
from race_server.net.transport.mailbox import Mailbox
from race_server.net.transport.server import Request, ServerLink

__all__ = ["DEFAULT_ADDRESS", "ClientLink", "Mailbox", "Request", "ServerLink", "open_session"]
