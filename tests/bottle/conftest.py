"""Generated inputs for the parsers of values."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence


def mutations(seeds: Sequence[str], count: int, alphabet: str, seed: int = 1) -> Iterator[str]:
    """Yield valid texts with one to four characters changed, put in, taken out or doubled; the same every time."""
    chance = random.Random(seed)
    for _ in range(count):
        text = chance.choice(seeds)
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(text) + 1)
            cut = at + chance.choice((0, 0, 1, 1, 8))
            put = chance.choice((chance.choice(alphabet), "", text[at : at + 5]))
            text = text[:at] + put + text[cut:]
        yield text


@pytest.fixture(name="mutations")
def _mutations() -> Callable[..., Iterator[str]]:
    return mutations
