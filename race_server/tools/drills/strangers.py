"""A process that opens connections without keys: junk, silence, or the beginning of a handshake."""

import asyncio
import json
import os
import ssl
import sys
import time
from contextlib import suppress

from race_server.net.open_files import raise_open_files

JUNK, IDLE, HELLO = "junk", "idle", "hello"
# Files for connections that are held open.
FILES = 20_000
# A connection with junk is open for this long [s].
JUNK_S = 0.05
OPEN_S = 2.0


class Strangers:
    """Connections of one kind to one place."""

    def __init__(self, source: str, port: int, kind: str) -> None:
        """Prepare. source: address that they come from."""
        self._source, self._port, self._kind = source, port, kind
        self._first = {JUNK: os.urandom(64), HELLO: client_hello()}.get(kind, b"")
        self.opened = self.failed = self.most_open = self._open = 0

    async def open_many(self, rate: float, seconds: float) -> None:
        """Open connections at a rate [1/s] for this long."""
        begun, sent, tasks = time.monotonic(), 0, set[asyncio.Task[None]]()
        while (passed := time.monotonic() - begun) < seconds:
            while sent < passed * rate:
                sent += 1
                task = asyncio.create_task(self._open_one())
                tasks.add(task)
                task.add_done_callback(tasks.discard)
            await asyncio.sleep(0.005)
        # Also those that are still being opened: nothing would end their silence later.
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _open_one(self) -> None:
        place = asyncio.open_connection("127.0.0.1", self._port, local_addr=(self._source, 0))
        try:
            reader, writer = await asyncio.wait_for(place, OPEN_S)
        except (OSError, asyncio.CancelledError):  # TimeoutError is an OSError
            self.failed += 1
            return
        self.opened += 1
        self._open += 1
        self.most_open = max(self.most_open, self._open)
        try:
            with suppress(OSError):
                if self._first:
                    writer.write(self._first)
                    await asyncio.sleep(JUNK_S)
                else:
                    await reader.read(1)  # until the other end closes it, or the attack is over
        finally:
            writer.close()
            self._open -= 1


def client_hello() -> bytes:
    """Return the first message of a TLS handshake."""
    sent = ssl.MemoryBIO()
    handshake = ssl.create_default_context().wrap_bio(
        ssl.MemoryBIO(), sent, server_hostname="localhost"
    )
    with suppress(ssl.SSLWantReadError):
        handshake.do_handshake()
    return sent.read()


def main(source: str, port: str, kind: str, rate: str, seconds: str) -> None:
    """Open connections, and print how many there were as JSON."""
    raise_open_files(FILES)
    strangers = Strangers(source, int(port), kind)
    asyncio.run(strangers.open_many(float(rate), float(seconds)))
    figures = {"opened": strangers.opened, "failed": strangers.failed}
    print(json.dumps(figures | {"most_open": strangers.most_open}))


if __name__ == "__main__":
    main(*sys.argv[1:])
