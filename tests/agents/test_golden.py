"""Golden vectors: what a port of the control unit has to repeat."""

from io import BytesIO

import numpy as np
import pytest

from race_agents.plant.golden_drive import golden_turns, turn_times
from race_agents.unit.fence import CourseFence
from race_agents.unit.golden import INPUTS, OUTPUTS, pack, run, unpack
from race_server.core.vehicle_presets import KART_60
from support.courses import ring


def test_the_unit_repeats_its_vectors_from_the_file() -> None:
    course = ring(radius=12.0, half_width=3.0)
    fence = CourseFence.of(course.line, course.half_widths, course.kerb, course.borders)
    turns = golden_turns(course, KART_60, seconds=7.0, seed=2, person_m=25.0)
    file = BytesIO()
    np.savez_compressed(file, allow_pickle=False, **pack(KART_60, fence, turns))
    with np.load(BytesIO(file.getvalue())) as arrays:
        again = run(KART_60, *unpack(arrays))
        outputs = arrays["outputs"]
        assert arrays["inputs"].shape == (350, len(INPUTS))
    assert outputs.shape == (350, len(OUTPUTS))
    assert again == pytest.approx(outputs, abs=1e-9, nan_ok=True)
    # The drive is worth repeating: the reflex acts in it, and warns before.
    stage = outputs[:, OUTPUTS.index("stage")]
    assert set(stage.tolist()) >= {0.0, 2.0, 3.0}
    assert outputs[:, OUTPUTS.index("brake")].max() == 1.0
    # Once the person has left the kart drives on.
    left = golden_turns(course, KART_60, seconds=10.0, seed=2, person_m=25.0, leaves_s=6.0)
    assert abs(left[300].readings.wheel_speed) < 0.5
    assert left[-1].readings.wheel_speed > 1.0
    # A generous guard against a turn that takes ten times as long; the figure is the bench's.
    assert np.median(turn_times(KART_60, fence, turns[:100], passes=2)) < 5e-3
