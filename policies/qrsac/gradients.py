"""Gradients with respect to a vector of parameters, of functions that may be compiled.

`torch.func` is what a compiled graph can hold. Calling it loads PyTorch's compiler, which takes longer than a
short training: where nothing is compiled it is `torch.autograd`, which comes to the same bits.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor


def pulled_back(
    function: Callable[[Tensor], Tensor], at: Tensor
) -> tuple[Tensor, Callable[[Tensor], Tensor]]:
    """What a function gives for a vector (p,), and what takes a gradient back through it.

    Returns:
        the value, and a function of the gradient (as the value) that gives the one of the vector (p,).
    """
    if torch.compiler.is_compiling():
        value, pull_back, *_ = torch.func.vjp(function, at)
        return value, lambda gradient: pull_back(gradient)[0]
    with torch.enable_grad():
        leaf = at.detach().requires_grad_()
        value = function(leaf)
    return value.detach(), lambda gradient: torch.autograd.grad(value, leaf, gradient)[0]


def gradient_and_value(
    function: Callable[[Tensor], tuple[Tensor, Tensor]], at: Tensor
) -> tuple[Tensor, tuple[Tensor, Tensor]]:
    """The gradient (p,) of a function's first scalar, and both that it gives for a vector (p,)."""
    if torch.compiler.is_compiling():
        return torch.func.grad_and_value(function, has_aux=True)(at)
    with torch.enable_grad():
        leaf = at.detach().requires_grad_()
        value, other = function(leaf)
    return torch.autograd.grad(value, leaf)[0], (value.detach(), other.detach())
