"""Layers whose inner products are of bfloat16 answer and learn as those of float32, to 8 bits."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from race_agents.training.half_stack import HalfStack, has_units, stack_of
from race_agents.training.stack import Layer, Rows, Stack

SIZES = (6, 64, 64, 64, 2)


def layers_by(draw: np.random.Generator, bends: str, *, whole: bool = False) -> list[Layer]:
    """Return layers: of small whole numbers, or such that answers are about as large as what is
    seen."""

    def numbers(*shape: int) -> Rows:
        if whole:
            return draw.integers(-1, 2, size=shape).astype(np.float32)
        return (draw.normal(size=shape) * np.sqrt(2.0 / shape[-1])).astype(np.float32)

    pairs = list(pairwise(SIZES))
    return [
        Layer(numbers(out, into), numbers(out), bends if place < len(pairs) - 1 else "")
        for place, (into, out) in enumerate(pairs)
    ]


def learned(stack: Stack, seen: Rows, error: Rows) -> tuple[Rows, Sequence[tuple[Rows, Rows]]]:
    """Return answers and the gradients of weights and biases."""
    answers = stack.answer(seen).copy()
    stack.learn(error.copy())
    return answers, stack.gradients


def test_factors_of_few_bits_lose_nothing() -> None:
    draw = np.random.default_rng(3)
    layers = layers_by(draw, "relu", whole=True)
    # One inner product: behind the first layer are at most 7, behind the second whole numbers
    # below 256 by this draw, which 8 bits hold.
    layers = [*layers[:2], layers[-1]]
    seen = draw.integers(-1, 2, size=(5, 6)).astype(np.float32)
    error = draw.integers(-1, 2, size=(5, 2)).astype(np.float32)
    answers, gradients = learned(Stack(layers, 8), seen, error)
    halves, by_halves = learned(HalfStack(layers, 8), seen, error)
    assert np.array_equal(halves, answers)
    for exact, half in zip(gradients, by_halves, strict=True):
        assert np.array_equal(half[0], exact[0])
        assert np.array_equal(half[1], exact[1])


@pytest.mark.parametrize("bends", ["relu", "tanh"])
def test_answers_are_within_a_twentieth_and_gradients_point_the_same_way(bends: str) -> None:
    draw = np.random.default_rng(4)
    layers = layers_by(draw, bends)
    seen = draw.normal(size=(300, 6)).astype(np.float32)
    error = draw.normal(size=(300, 2)).astype(np.float32)
    answers, gradients = learned(Stack(layers, 512), seen, error)
    halves, by_halves = learned(HalfStack(layers, 512), seen, error)
    assert np.abs(halves - answers).max() < 0.05 * np.abs(answers).max()
    for exact, half in zip(gradients, by_halves, strict=True):
        for one, other in zip(exact, half, strict=True):
            cosine = np.vdot(one, other) / (np.linalg.norm(one) * np.linalg.norm(other))
            assert cosine > 0.99


def test_fewer_rows_than_there_is_room_for_answer_the_same() -> None:
    draw = np.random.default_rng(5)
    stack = HalfStack(layers_by(draw, "relu"), 64)
    seen = draw.normal(size=(64, 6)).astype(np.float32)
    assert np.allclose(stack.answer(seen[:3]).copy(), stack.answer(seen)[:3], atol=0.02)


def test_a_network_without_inner_products_multiplies_float32() -> None:
    layers = layers_by(np.random.default_rng(6), "tanh")
    assert type(stack_of([layers[0], layers[-1]], 8, halves=True)) is Stack
    assert type(stack_of(layers, 8, halves=False)) is Stack
    assert type(stack_of(layers, 8, halves=True)) is (HalfStack if has_units() else Stack)
