"""Parts of a study, for machines that do not talk to each other: each measures one, and `merge` joins the folders."""

import hashlib
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from shadowbench.errors import InputError
from shadowbench.measure.cells import Block

T = TypeVar("T")
_MOST = 10_000  # parts


@dataclass(frozen=True)
class Part:
    """Part `number` of `count`, from 1; 1 of 1 is the whole."""

    number: int = 1
    count: int = 1

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def of(self, items: Sequence[T], identity: Callable[[T], object]) -> list[T]:
        """The items of this part, in their order; parts differ in length by at most one.

        They are dealt in the order of hashes, which mixes large and small ones, and is the same on every machine.
        identity: a JSON value unique to an item. Raises InputError for fewer items than parts.
        """
        if len(items) < self.count:
            raise InputError(
                f"--part {self}: found {len(items)} to divide, as the cells of a view stay together; allowed: 1 to "
                f"{len(items)} parts"
            )
        order = sorted(range(len(items)), key=lambda index: _digest(identity(items[index])))
        return [items[index] for index in sorted(order[self.number - 1 :: self.count])]

    def of_blocks(self, blocks: Sequence[Block]) -> list[Block]:
        """The blocks of this part."""
        return self.of(blocks, lambda block: [block.scene.name, block.view.camera.name, block.view.light.name])


WHOLE = Part()


def part_of(text: str | None) -> Part:
    """The part that `K/N` names; the whole for None. Raises InputError."""
    if text is None:
        return WHOLE
    found = re.fullmatch(r"([0-9]{1,5})/([0-9]{1,5})", text)
    number, count = map(int, found.groups()) if found else (0, 0)
    if not 1 <= number <= count <= _MOST:
        raise InputError(
            f"--part: found {text!r:.60}; allowed: K/N, as in 3/16, with K from 1 to N and N up to {_MOST}"
        )
    return Part(number, count)


def _digest(identity: object) -> bytes:
    return hashlib.sha256(json.dumps(identity).encode()).digest()
