"""A link that stalls: it stays open and carries nothing, as where packet after packet is lost."""

import socket
import threading
from contextlib import suppress
from typing import Self

from race_server.competition.launch import free_address


class StalledLink:
    """Carries bytes between clients and a server, until the links that exist are frozen."""

    def __init__(self, server: str) -> None:
        """Carry for a server at an address ``tcp/host:port``; clients connect to `address`."""
        self._server = _place_of(server)
        self.address = free_address()
        self._open = socket.create_server(_place_of(self.address))
        self._sockets: list[socket.socket] = [self._open]
        self._frozen: set[socket.socket] = set()
        threading.Thread(target=self._accept, daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                here, _ = self._open.accept()
                try:
                    there = socket.create_connection(self._server)
                except ConnectionRefusedError:  # the server is still starting
                    here.close()
                    continue
                self._sockets += [here, there]
                for ends in ((here, there), (there, here)):
                    threading.Thread(target=self._carry, args=ends, daemon=True).start()

    def _carry(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                if source not in self._frozen:
                    sink.sendall(data)

    def freeze(self) -> None:
        """Carry nothing more on the links that exist; they stay open, and new ones carry."""
        self._frozen.update(self._sockets)

    def close(self) -> None:
        """Close all links."""
        for end in self._sockets:
            end.close()


def _place_of(address: str) -> tuple[str, int]:
    host, port = address.removeprefix("tcp/").split(":")
    return host, int(port)
