"""The strangers of the flood drill end with their attack, whatever the place attacked does."""

import asyncio
import socket
import time
from contextlib import ExitStack
from threading import Thread

from race_server.tools.drills.strangers import IDLE, Strangers


def test_a_connection_that_is_let_in_after_the_attack_is_not_waited_for() -> None:
    # Connections that find the queue full are tried again by the system after a second. By then the
    # attack is over, and they are taken and never closed.
    with ExitStack() as held, socket.create_server(("127.0.0.1", 0), backlog=1) as listener:

        def take_all_late() -> None:
            time.sleep(0.5)
            while True:
                try:
                    held.enter_context(listener.accept()[0])
                except OSError:  # it is closed
                    return

        Thread(target=take_all_late, daemon=True).start()
        strangers = Strangers("127.0.0.1", listener.getsockname()[1], IDLE)
        asyncio.run(asyncio.wait_for(strangers.open_many(50.0, 0.3), 5.0))
        assert 0 < strangers.opened < 5 < strangers.failed
        listener.shutdown(socket.SHUT_RDWR)
