"""Calls made in processes of their own, one a CPU: drawing is Python, at which threads would take turns."""

import multiprocessing
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

from study.core.run import USABLE

T = TypeVar("T")
_calls: Sequence[Callable[[], object]] = ()  # found by the children, which are forked: calls cannot be sent


def _one(number: int) -> object:
    return _calls[number]()


def in_processes(calls: Sequence[Callable[[], T]]) -> list[T]:
    """Results of the calls in order, which must be picklable. Raises what the first bad call raises."""
    global _calls
    if min(len(calls), len(USABLE)) < 2:
        return [call() for call in calls]
    _calls = calls
    try:
        with warnings.catch_warnings():  # of forking beside threads: those of NumPy, which outlive a fork
            warnings.simplefilter("ignore", DeprecationWarning)
            forked = multiprocessing.get_context("fork")
            with ProcessPoolExecutor(min(len(calls), len(USABLE)), mp_context=forked) as pool:
                return list(pool.map(_one, range(len(calls))))
    finally:
        _calls = ()
