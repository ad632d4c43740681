"""Dense layers whose inner products are of bfloat16: faster on a processor that has units for it.

Factors have 8 bits, and products are added up in float32. Parameters, their gradients, what a
network sees and what it answers are float32: the first and the last layer are as in `Stack`.
"""

import numpy as np
import torch

from race_agents.training.stack import Layer, Rows, Stack, bent

INNER = slice(1, -1)  # of the layers


def stack_of(layers: list[Layer], rows: int, *, halves: bool) -> Stack:
    """Return layers with room for up to n rows.

    halves: with inner products of bfloat16, where the processor has units and there are such.
    """
    return (HalfStack if halves and has_units() and layers[INNER] else Stack)(layers, rows)


def has_units() -> bool:
    """Return whether this processor multiplies numbers of bfloat16 (AMX, AVX512-BF16)."""
    ask = getattr(torch.ops.mkldnn, "_is_mkldnn_bf16_supported", None)
    return ask is not None and bool(ask())  # not all builds of PyTorch have it


class HalfStack(Stack):
    """Layers with room for the answers and gradients of up to n rows."""

    def __init__(self, layers: list[Layer], rows: int) -> None:
        super().__init__(layers, rows)
        inner = layers[INNER]
        self._weights = [_half(*layer.weight.shape) for layer in inner]
        self._slopes = [_half(*layer.weight.shape) for layer in inner]  # of the loss by these
        self._biases = [_half(*layer.bias.shape) for layer in inner]
        # What lies behind each layer but the last, and the gradients of the loss by it.
        self._behind = [_half(rows, len(layer.bias)) for layer in layers[:-1]]
        self._above = [_half(rows, len(layer.bias)) for layer in layers[:-1]]
        self.renew()

    def renew(self) -> None:
        """Round the parameters, which have changed."""
        for layer, weight, bias in zip(
            self.layers[INNER], self._weights, self._biases, strict=True
        ):
            weight.copy_(torch.from_numpy(layer.weight))
            bias.copy_(torch.from_numpy(layer.bias))

    def answer(self, seen: Rows) -> Rows:
        """Return the answers (n, out) to rows (n, in); they last until the next call."""
        self._seen, count = seen, len(seen)
        first, *inner, last = self.layers
        answers = self._answers[0][:count]
        np.dot(seen, first.weight.T, out=answers)
        below = self._behind[0][:count].copy_(torch.from_numpy(bent(answers, first)))
        for layer, weight, bias, behind in zip(
            inner, self._weights, self._biases, self._behind[1:], strict=True
        ):
            below = torch.addmm(bias, below, weight.t(), out=behind[:count])
            if layer.bends == "tanh":
                torch.tanh_(below)
            else:
                below.view(torch.int16).clamp_(min=0)  # which has the same sign
        full = self._answers[-2][:count]
        torch.from_numpy(full).copy_(below)
        answers = self._answers[-1][:count]
        np.dot(full, last.weight.T, out=answers)
        return bent(answers, last)

    def learn(self, error: Rows) -> None:
        """Fill `gradients` from the gradient (n, out) of the loss by what was answered last."""
        count = len(error)
        weight, bias = self.gradients[-1]
        np.dot(error.T, self._answers[-2][:count], out=weight)
        np.sum(error, axis=0, out=bias)
        errors = self._errors[-1][:count]
        np.dot(error, self.layers[-1].weight, out=errors)
        above = self._above[-1][:count].copy_(torch.from_numpy(errors))
        self._unbend(above, len(self.layers) - 2)
        for place in reversed(range(1, len(self.layers) - 1)):
            slopes, (weight, bias) = self._slopes[place - 1], self.gradients[place]
            torch.mm(above.t(), self._behind[place - 1][:count], out=slopes)
            torch.from_numpy(weight).copy_(slopes)
            torch.sum(above, 0, dtype=torch.float32, out=torch.from_numpy(bias))
            below = self._above[place - 1][:count]
            above = torch.mm(above, self._weights[place - 1], out=below)
            self._unbend(above, place - 1)
        weight, bias = self.gradients[0]
        errors = self._answers[0][:count]  # which are not needed any more
        torch.from_numpy(errors).copy_(above)
        np.dot(errors.T, self._seen, out=weight)
        np.sum(errors, axis=0, out=bias)

    def _unbend(self, above: torch.Tensor, place: int) -> None:
        """Multiply gradients behind a layer by the slope of its bend."""
        behind = self._behind[place][: len(above)]
        if self.layers[place].bends == "tanh":
            torch.ops.aten.tanh_backward(above, behind, grad_input=above)
        else:
            torch.ops.aten.threshold_backward(above, behind, 0, grad_input=above)


def _half(*shape: int) -> torch.Tensor:
    return torch.empty(shape, dtype=torch.bfloat16)
