"""Tests of pages run no kernel in their own process."""

import pytest


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    """Compile nothing, so that these tests run while another process compiles the tick."""
