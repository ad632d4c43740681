"""Dense layers with their gradients written out, by numpy.

Axis letters: n rows of a part, S numbers of an observation, A of an action.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float32]


@dataclass(frozen=True)
class Layer:
    """A dense layer: the policy's numbers, in its own memory, and what lies behind it."""

    weight: Rows  # (out, in)
    bias: Rows  # (out,)
    bends: str  # tanh, relu, or nothing behind the last


class Stack:
    """Layers with room for the answers and gradients of up to n rows."""

    def __init__(self, layers: list[Layer], rows: int) -> None:
        self.layers = layers
        self._answers = [np.empty((rows, len(layer.bias)), np.float32) for layer in layers]
        self._errors = [np.empty((rows, layer.weight.shape[1]), np.float32) for layer in layers]
        self.gradients = [
            (np.empty_like(layer.weight), np.empty_like(layer.bias)) for layer in layers
        ]
        self._seen = self._answers[0]

    def renew(self) -> None:
        """Take parameters that have changed; here they are in the same memory."""

    def answer(self, seen: Rows) -> Rows:
        """Return the answers (n, out) to rows (n, in); they last until the next call."""
        self._seen = below = seen
        for layer, room in zip(self.layers, self._answers, strict=True):
            answers = room[: len(seen)]
            np.dot(below, layer.weight.T, out=answers)
            below = bent(answers, layer)
        return below

    def learn(self, error: Rows) -> None:
        """Fill `gradients` from the gradient (n, out) of the loss by what was answered last."""
        above = error
        for place in reversed(range(len(self.layers))):
            layer, (weight, bias) = self.layers[place], self.gradients[place]
            below = self._answers[place - 1][: len(above)] if place else self._seen
            np.dot(above.T, below, out=weight)
            np.sum(above, axis=0, out=bias)
            if not place:
                return
            errors = self._errors[place][: len(above)]
            np.dot(above, layer.weight, out=errors)
            if self.layers[place - 1].bends == "tanh":
                # By 1 - tanh², of which the square is not needed any more.
                np.multiply(below, below, out=below)
                np.subtract(1.0, below, out=below)
                np.multiply(errors, below, out=errors)
            else:
                np.multiply(errors, below > 0.0, out=errors)
            above = errors


def bent(answers: Rows, layer: Layer) -> Rows:
    """Return products (n, out) with the bias and what lies behind, in the same memory."""
    np.add(answers, layer.bias, out=answers)
    if layer.bends == "tanh":
        np.tanh(answers, out=answers)
    elif layer.bends == "relu":
        np.maximum(answers, 0.0, out=answers)
    return answers
