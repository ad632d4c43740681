"""Fixtures of the tests of gateways."""

from collections.abc import Iterator

import pytest

from race_server.competition.launch import free_address
from support.served_race import ServedRace, gated, racing, wait_for_race


@pytest.fixture(scope="module")
def private_folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the steward's token of these races apart from those of other tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("runtime")))
        yield


@pytest.fixture(scope="module")
def served(private_folders: None) -> Iterator[ServedRace]:
    """Two scripted karts that race without end, and a gateway."""
    address = free_address()
    with racing(address) as server, gated(address) as served:
        served.server = server
        wait_for_race(served)
        yield served
