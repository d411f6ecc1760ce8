"""Made-up files of a run made whole: what a test does not say of them has any value of its type."""

from __future__ import annotations

import functools
import json
import re
import types
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import msgspec

from study.core import cli, registry, schema, store
from study.core.registry import ROOT, Phase, Scene
from study.core.schema import File
from study.experiments import experiment


@functools.cache
def schemas() -> dict[str, type[File]]:
    """File name → its schema, over all experiments."""
    return {name: kind for one in experiment.find_all().values() for name, kind in one.schemas.items()}


def alternatives(kind: Any) -> list[Any]:
    """The types that a value may have, without what a key says of itself, and null."""
    if get_origin(kind) is Annotated:
        return alternatives(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        return [one for each in get_args(kind) for one in alternatives(each)]
    return [] if kind is type(None) else [kind]


def blank(kind: Any, least: int = 0) -> Any:
    """A value of the type: null where it may be, else the least; of a list so many entries."""
    if type(None) in get_args(kind):
        return None
    (one, *_) = alternatives(kind)
    if get_origin(one) is Literal:
        return get_args(one)[0]
    if schema.is_record(one):
        return filled({}, one)
    if get_origin(one) is list:
        return [blank(get_args(one)[0]) for _ in range(least)]
    return {str: "", bool: False, int: 1, float: 1.0}.get(one, {})


def filled(data: Any, kind: Any) -> Any:
    """`data` with what the type requires beside it."""
    for one in alternatives(kind):
        if isinstance(data, dict) and schema.is_record(one):
            known = {name: inner for name, inner, _ in schema.fields(one)}
            least = {name: about.min_length or 0 for name, _, about in schema.fields(one)}
            needed = [each.encode_name for each in msgspec.structs.fields(one) if each.required]
            found = {name: filled(value, known.get(name, Any)) for name, value in data.items()}
            return found | {name: blank(known[name], least[name]) for name in needed if name not in data}
        if isinstance(data, dict) and get_origin(one) is dict:
            return {name: filled(value, get_args(one)[1]) for name, value in data.items()}
        if isinstance(data, list) and get_origin(one) is list:
            return [filled(value, get_args(one)[0]) for value in data]
        if isinstance(data, float) and one is int and data.is_integer():
            return int(data)
    return data


def write(path: Path, content: Any) -> None:
    """The run's file `path`, made whole by the schema of its name."""
    store.write_text(path, text(path.name, content))


def text(name: str, content: Any) -> str:
    """The text of the run's file of that name."""
    return json.dumps(filled(cli.plain(content), schemas()[name]))


RUN = ROOT / "results" / "reference" / "zen5-2026-11-30"


def published(name: str) -> dict[str, Any]:
    """The content of its file, without where it was made."""
    return {key: value for key, value in store.read_json(RUN / name).items() if key != "context"}


def figure(text: str) -> float:
    """The first number of a cell: 1.25 of `1.25× [1.20, 1.30]`."""
    return float(re.findall(r"[\d,]+\.?\d*", text)[0].replace(",", ""))


# --- scenes of both classes, and phases of any tolerance, for the gate

SMOOTH = Scene("trio", ROOT / "common/scenes/trio.json", {}, False)
FRACTAL = Scene("mandelbulb", ROOT / "common/scenes/mandelbulb.json", {}, True)


def phase(tolerance: dict, name: str = "opt9", isa: tuple[str, ...] = ()) -> Phase:
    return msgspec.structs.replace(registry.find_phase("opt1"), name=name, tolerance=tolerance, isa=list(isa))


def bound(reason: str = "measured", **bounds: object) -> dict:
    return {**bounds, "reason": reason}


# A machine with round ceilings: instructions per core cycle; a division takes 8 cycles, a square root 16.
ROUND_RATES = {
    **{"fma": 2.0, "add": 2.0, "mul": 2.0, "minmax": 2.0, "div": 0.125, "sqrt": 0.0625},
    **{"rsqrt": None, "add+mul": 3.0, "add+2mul": 2.5, "2add+mul": 2.5},
}
ROUND_BYTES = {"L1": 128.0, "L2": 64.0, "L3": 16.0, "memory": 4.0}


def round_ceilings() -> dict:
    """ceilings.json of a machine with the rates above at every width up to 256 bits, and nothing wider."""
    rows = []

    def add(about: dict, rate: float | None, per_instruction: float) -> None:
        if rate is None or about["bits"] == 512:
            rows.append({**about, "value": None, "reason": "this CPU lacks it"})
            return
        value = rate * per_instruction
        spread = {"value": value, "median": value * 0.99, "low": value * 0.98, "high": value}
        rows.append({**about, **spread, "per_second": value * 4e9, "instructions_per_core_cycle": rate})

    for precision, element in (("double", 64), ("single", 32)):
        for bits in (element, 128, 256, 512):
            for name, rate in ROUND_RATES.items():
                about = {"name": name, "precision": precision, "bits": bits, "unit": "flop/core cycle"}
                add(about, rate, bits / element * (2 if name == "fma" else 1))
    for level, value in ROUND_BYTES.items():
        for name in ("load", "store", "copy"):
            for bits in (64, 128, 256, 512):
                about = {"name": name, "level": level, "bits": bits, "unit": "byte/core cycle"}
                about |= {"working_set_bytes": 1 << 14}
                add(about, value / (bits / 8) * bits / 256 * (1 if name == "copy" else 0.5), bits / 8)
    return {"schema": 1, "tsc_hz": 2.5e9, "core_hz": 4e9, "ceilings": rows}
