"""What was executed in the timed region, as every measuring back end reports it."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from study.core.cli import StudyError
from study.counting.decode import FLOPS, Decoded

# Kind, precision and width in bits (the element's where scalar): what FLOPs are told apart by.
Operation = tuple[str, str, int]


@dataclass
class Counts:
    """Of one function without its callees, or of everything.

    `lanes`: operations executed, lane by lane, with only the active ones of masked instructions. `load`,
    `store`: bytes as the core sees them. `mix`: instructions by counting.decode.MIX. `doublings`: lanes of
    the sums x + x, which are among `lanes`, too.
    """

    calls: int = 0
    instructions: int = 0
    lanes: Counter[Operation] = field(default_factory=Counter)
    load: int = 0
    store: int = 0
    mix: Counter[str] = field(default_factory=Counter)
    doublings: int = 0

    @property
    def machine(self) -> int:
        """FLOPs by the machine convention."""
        return sum(FLOPS[kind] * n for (kind, _, _), n in self.lanes.items())

    def add(self, one: Decoded, times: int, active: int | None = None) -> None:
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
        self.mix[one.mix] += times
        self.load += one.load * times
        self.store += one.store * times
        if one.kind and one.precision:
            lanes = one.lanes * times if active is None else active
            self.lanes[one.kind, one.precision, one.bits] += lanes
            self.doublings += lanes if one.doubling else 0

    def merge(self, other: Counts) -> None:
        """Adds another's."""
        self.calls += other.calls
        self.instructions += other.instructions
        self.load += other.load
        self.store += other.store
        self.doublings += other.doublings
        self.lanes.update(other.lanes)
        self.mix.update(other.mix)

    def split(self, weights: Sequence[int]) -> list[Counts]:
        """Whole-numbered parts in proportion to the weights that add up to this: nothing is lost or made."""
        ends = [sum(weights[: i + 1]) for i in range(len(weights))]

        def parts(n: int) -> list[int]:
            upto = [0, *(n * end // ends[-1] for end in ends)]
            return [b - a for a, b in itertools.pairwise(upto)]

        made = [
            Counts(calls, instructions, load=load, store=store, doublings=doublings)
            for calls, instructions, load, store, doublings in zip(
                *map(parts, (self.calls, self.instructions, self.load, self.store, self.doublings)),
                strict=True,
            )
        ]
        for counter in ("lanes", "mix"):
            for key, n in getattr(self, counter).items():
                for part, share in zip(made, parts(n), strict=True):
                    getattr(part, counter)[key] += share
        return made

    def by_kind(self) -> dict[str, int]:
        """Operations, lane by lane, by kind."""
        found: Counter[str] = Counter()
        for (kind, _, _), n in self.lanes.items():
            found[kind] += n
        return dict(found)

    def to_json(self) -> dict[str, Any]:
        return {
            "calls": self.calls,
            "machine": self.machine,
            "instructions": self.instructions,
            "operations": [
                {"kind": kind, "precision": precision, "bits": bits, "lanes": n}
                for (kind, precision, bits), n in sorted(self.lanes.items())
            ],
            "load_bytes": self.load,
            "store_bytes": self.store,
            "mix": dict(sorted(self.mix.items())),
            "doublings": self.doublings,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Counts:
        lanes = {(o["kind"], o["precision"], o["bits"]): o["lanes"] for o in data["operations"]}
        return cls(
            data["calls"],
            data["instructions"],
            Counter(lanes),
            data["load_bytes"],
            data["store_bytes"],
            Counter(data["mix"]),
            data.get("doublings", 0),
        )


@dataclass
class Measured:
    """One picture's timed region by one back end.

    `functions`: without libm and libc, whose inside is `outside` (None: the back end does not see it).
    `variant`: "shipped" (the very code that is timed) or "calls" (the same source without inlining).
    `calibrated`: whether the back end gave the calibration program's known counts on this machine; None:
    it was never run on the real thing. `edges`: caller to callee (of the phase or a library) to the number
    of direct calls, where the back end sees them. `compiler`, `flags`: of the program; `cpu`: it ran on;
    `kernel`: of a phase that generates code for a scene, that it did not (study.core.run.GENERAL).
    """

    backend: str
    phase: str
    flags_from: str
    variant: str
    scene: str
    scene_hash: str
    width: int
    height: int
    total: Counts
    functions: dict[str, Counts]
    outside: dict[str, Counts] | None
    calibrated: bool | None
    edges: dict[str, dict[str, int]] = field(default_factory=dict)
    compiler: str | None = None
    flags: str | None = None
    cpu: str | None = None
    kernel: str | None = None

    def to_json(self) -> dict[str, Any]:
        data = {k: v for k, v in vars(self).items() if k not in ("total", "functions", "outside")}
        data["total"] = self.total.to_json()
        data["functions"] = {name: counts.to_json() for name, counts in self.functions.items()}
        data["outside"] = self.outside and {name: c.to_json() for name, c in self.outside.items()}
        return data

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Measured:
        """Raises KeyError or TypeError for another thing's JSON."""
        known = dict(data)
        known["total"] = Counts.from_json(data["total"])
        known["functions"] = {name: Counts.from_json(c) for name, c in data["functions"].items()}
        outside = data["outside"]
        known["outside"] = outside and {name: Counts.from_json(c) for name, c in outside.items()}
        return cls(**known)
