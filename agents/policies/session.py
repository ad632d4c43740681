"""Run a policy: ONNX Runtime on one thread, without PyTorch or pickle."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.policies.metadata import INPUT, OUTPUT, PolicyMetadata, metadata_of
from race_agents.policies.registry import policy_bytes
from race_server.envs.actions import ACTIONS, WIDTHS
from race_server.errors import DriverError

Float32s = NDArray[np.float32]
MOST_WORDS = 200  # characters of an error of the runtime


class Policy:
    """A network with its normalisation and its metadata."""

    def __init__(self, path: Path) -> None:
        """Load the policy of a file.

        Raises:
            DriverError: the file is damaged or foreign, or ONNX Runtime is not installed.
        """
        self.name = str(path)
        self._session = _session_of(path)
        properties = self._session.get_modelmeta().custom_metadata_map
        self.metadata: PolicyMetadata = metadata_of(properties, self.name)
        self._check_shapes()

    def _check_shapes(self) -> None:
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        size, width = self.metadata.size, WIDTHS[ACTIONS[self.metadata.action]]
        seen, answer = _columns_of(inputs, INPUT), _columns_of(outputs, OUTPUT)
        if len(inputs) != 1 or (seen, answer) != (size, width):
            raise DriverError(
                f"{self.name}: its network takes {seen} numbers and gives {answer}; its metadata "
                f"speak of {size} and {width}; export it again"
            )

    def decide(self, seen: Float32s) -> Float32s:
        """Return the actions (n, A) for observations (n, size).

        Raises:
            DriverError: the network fails, or answers with other than finite numbers.
        """
        try:
            actions: Float32s = self._session.run([OUTPUT], {INPUT: seen})[0]
        except Exception as error:  # the runtime's errors have no common class
            reason = str(error).partition("\n")[0][:MOST_WORDS]
            raise DriverError(f"{self.name} cannot answer: {reason}; train it again") from error
        # Checked here, as the declared shape need not hold and kernels do not check it.
        wanted = (len(seen), WIDTHS[ACTIONS[self.metadata.action]])
        if actions.shape != wanted:
            raise DriverError(
                f"{self.name} answers with {actions.shape} numbers instead of {wanted}; "
                "export it again"
            )
        if not np.isfinite(actions).all():
            raise DriverError(
                f"{self.name} answers with {actions.tolist()[0]}, which are not all finite; "
                "train it again"
            )
        return actions


def _columns_of(ends: Any, name: str) -> Any:
    """Return the number of columns of an input or output; 0 if it is no table of floats."""
    for one in ends:
        if one.name == name and one.type == "tensor(float)" and len(one.shape) == 2:
            return one.shape[1]
    return 0


def _session_of(path: Path) -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise DriverError(
            f"{path}: onnxruntime is not installed: `pip install onnxruntime` installs it"
        ) from error
    options = onnxruntime.SessionOptions()
    # A network this small is slower on many threads, and a race has many drivers.
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(
            policy_bytes(path), options, providers=["CPUExecutionProvider"]
        )
    except DriverError:
        raise
    except Exception as error:  # the runtime's errors have no common class
        raise DriverError(f"{path} is damaged or no ONNX file; export it again") from error
