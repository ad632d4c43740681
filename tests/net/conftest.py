"""The keys of a session of two seats."""

from pathlib import Path

import pytest

from race_server.net.auth.issue import Order, issue_keys


@pytest.fixture(scope="session")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys") / "cup"
    issue_keys(Order("cup", 2, spectators=1, hosts=("10.0.0.7",)), folder)
    return folder
