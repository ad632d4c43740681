"""Run a policy: ONNX Runtime on one thread, without PyTorch or pickle."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.policies.metadata import INPUT, OUTPUT, PolicyMetadata, metadata_of
from race_agents.policies.network import Network, network_in
from race_agents.policies.registry import policy_bytes
from race_server.envs.actions import ACTIONS, WIDTHS
from race_server.errors import DriverError

Float32s = NDArray[np.float32]
MOST_WORDS = 200  # characters of an error of the runtime


class Policy:
    """A network with its normalisation and its metadata."""

    def __init__(self, path: Path, data: bytes | None = None) -> None:
        """Load the policy of a file. data: of a file that is not written yet.

        Raises:
            DriverError: the file is damaged or foreign, or ONNX Runtime is not installed.
        """
        self.name = str(path)
        data = policy_bytes(path) if data is None else data
        network = network_in(data, self.name)
        self.metadata: PolicyMetadata = metadata_of(network.metadata, self.name)
        self._check_shapes(network)
        # Only now: what was checked costs a known amount of time and memory.
        self._session = _session_of(data, self.name)

    def _check_shapes(self, network: Network) -> None:
        size, width = self.metadata.size, WIDTHS[ACTIONS[self.metadata.action]]
        if (network.columns, network.answers) != (size, width):
            raise DriverError(
                f"{self.name}: its network takes {network.columns} numbers and gives "
                f"{network.answers}; its metadata speak of {size} and {width}; export it again"
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
        # Kernels do not check it; `network_in` has, for every network that it lets through.
        assert actions.shape == (len(seen), WIDTHS[ACTIONS[self.metadata.action]])
        if not np.isfinite(actions).all():
            raise DriverError(
                f"{self.name} answers with {actions.tolist()[0]}, which are not all finite; "
                "train it again"
            )
        return actions


def _session_of(data: bytes, name: str) -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise DriverError(
            f"{name}: onnxruntime is not installed: `pip install onnxruntime` installs it"
        ) from error
    options = onnxruntime.SessionOptions()
    # A network this small is slower on many threads, and a race has many drivers.
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime's errors have no common class
        raise DriverError(f"{name} is damaged or no ONNX file; export it again") from error
