"""Subsets of long parameter lists: pairs in place of products, and what `make test-slow` runs of a list."""

import datetime
from collections.abc import Collection, Iterable, Sequence
from itertools import combinations, product
from typing import Any

import pytest


def sampled(values: Iterable[Any], sample: Collection[Any]) -> list[Any]:
    """Arguments of `parametrize`, a tuple for several; those outside the sample are marked `exhaustive`."""
    values = list(values)
    assert set(sample) <= set(values)
    return [
        pytest.param(
            *(value if isinstance(value, tuple) else (value,)), marks=[] if value in sample else pytest.mark.exhaustive
        )
        for value in values
    ]


def todays(values: Sequence[Any], days: int) -> Sequence[Any]:
    """Each day other values, so that in so many days all are taken."""
    return values[datetime.date.today().toordinal() % days :: days]


def daily(values: Sequence[Any], days: int) -> list[Any]:
    """All values as arguments of `parametrize`, of which `make test-slow` runs today's."""
    return sampled(values, todays(values, days))


def pairs(*factors: Iterable[Any]) -> list[tuple[Any, ...]]:
    """Rows in which each two values of different factors meet at least once, far fewer than the product."""
    rows = list(product(*factors))
    places = list(combinations(range(len(factors)), 2))

    def met(row: tuple[Any, ...]) -> set[tuple[Any, ...]]:
        return {(i, j, row[i], row[j]) for i, j in places}

    missing, chosen = set().union(*map(met, rows)), []
    while missing:
        chosen.append(max(rows, key=lambda row: len(met(row) & missing)))
        missing -= met(chosen[-1])
    return chosen


def by_turns(values: Iterable[Any], *others: Sequence[Any]) -> list[tuple[Any, ...]]:
    """Each value once, with the others' values in turn."""
    return [(value, *(other[turn % len(other)] for other in others)) for turn, value in enumerate(values)]
