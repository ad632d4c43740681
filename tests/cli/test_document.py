"""The one JSON document that a command prints."""

import json
import math

import pytest

from race_server.cli.document import print_document


def test_a_number_that_is_not_finite_is_null_in_a_document(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_document(
        {"rows": [{"ratio": math.nan, "lap_s": math.inf}, [-math.inf, 0.1]], "nan": "NaN"}
    )
    document = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert document == {"rows": [{"ratio": None, "lap_s": None}, [None, 0.1]], "nan": "NaN"}
