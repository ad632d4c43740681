"""The words by which a browser is refused, and the codes with which its socket closes."""

import json

from race_server.errors import GatewayError

# Of the range that is left to programs, near the statuses of HTTP that mean the same.
CLOSE_CODES = {
    "malformed": 4400,
    "token": 4401,
    "origin": 4403,
    "no-recording": 4404,
    "late": 4408,
    "seat-taken": 4409,
    "used": 4410,
    "seat-lost": 4411,
    "too-large": 4413,
    "slow": 4414,
    "too-fast": 4429,
    "full": 4430,
    "no-race": 4503,
}
# What a frame that closes a WebSocket has room for.
MOST_REASON = 120


def refusal_text(error: GatewayError) -> str:
    """Return what a browser is told before its socket closes."""
    return json.dumps({"type": "refused", "code": error.code, "reason": str(error)})


def close_reason(error: GatewayError) -> str:
    """Return the sentence as far as it fits into the frame that closes a socket."""
    return f"{error.code}: {error}".encode()[:MOST_REASON].decode(errors="ignore")
