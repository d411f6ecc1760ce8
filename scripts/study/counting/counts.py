"""What was executed, as it is added up: every measuring back end makes these."""

import itertools
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

from study.core.cli import StudyError
from study.counting.schema import FLOPS, Executed, Operation

if TYPE_CHECKING:  # its decoder has no wheel for arm64
    from study.counting.decode import Decoded

# Kind, precision and width in bits (the element's where scalar): what FLOPs are told apart by.
Kind = tuple[str, str, int]


@dataclass
class Counts:
    """What one function executed without its callees, or the whole program.

    `lanes`: operations executed, lane by lane, with only the active ones of masked instructions. `load`,
    `store`: bytes as the core sees them.
    """

    calls: int = 0
    instructions: int = 0
    lanes: Counter[Kind] = field(default_factory=Counter)
    load: int = 0
    store: int = 0

    @property
    def machine(self) -> int:
        return sum(FLOPS[kind] * n for (kind, _, _), n in self.lanes.items())

    def add(self, one: "Decoded", times: int, active: int | None = None) -> None:
        """`times` executions of an instruction; `active`: lanes summed over them, where it is masked.
        StudyError for one whose arithmetic is not counted.
        """
        if not times:
            return
        if one.uncounted:
            raise StudyError(
                f"{one.mnemonic} was executed at {one.address:#x}: what it computes is not counted; "
                "build the phase without it"
            )
        self.instructions += times
        self.load += one.load * times
        self.store += one.store * times
        if one.kind:
            self.lanes[one.kind, one.precision, one.bits] += one.lanes * times if active is None else active

    def merge(self, other: Self) -> None:
        self.calls += other.calls
        self.instructions += other.instructions
        self.load += other.load
        self.store += other.store
        self.lanes.update(other.lanes)

    def split(self, weights: Sequence[int]) -> list[Self]:
        """Whole-numbered parts in proportion to the weights that add up to this: nothing is lost or made."""
        ends = [0, *itertools.accumulate(weights)]

        def part(begin: int, end: int) -> Any:
            def of(n: int) -> int:
                return n * end // ends[-1] - n * begin // ends[-1]

            lanes = Counter({kind: of(n) for kind, n in self.lanes.items()})
            return type(self)(of(self.calls), of(self.instructions), lanes, of(self.load), of(self.store))

        return [part(*pair) for pair in itertools.pairwise(ends)]

    def executed(self) -> Executed:
        operations = [Operation(*kind, n) for kind, n in sorted(self.lanes.items())]
        return Executed(
            calls=self.calls,
            machine=self.machine,
            instructions=self.instructions,
            operations=operations,
            load_bytes=self.load,
            store_bytes=self.store,
        )

    @classmethod
    def of(cls, found: Executed) -> Self:
        """`found` again as it is added up."""
        lanes = Counter({(one.kind, one.precision, one.bits): one.lanes for one in found.operations})
        return cls(found.calls, found.instructions, lanes, found.load_bytes, found.store_bytes)

    @classmethod
    def total(cls, several: Iterable[Self]) -> Self:
        made = cls()
        for one in several:
            made.merge(one)
        return made
