"""ceilings.json with round numbers, for tests of roofs."""

from __future__ import annotations

# Instructions per core cycle; a division takes 8 cycles, a square root 16.
RATES = {
    **{"fma": 2.0, "add": 2.0, "mul": 2.0, "minmax": 2.0, "div": 0.125, "sqrt": 0.0625},
    **{"rsqrt": None, "add+mul": 3.0, "add+2mul": 2.5, "2add+mul": 2.5},
}
BYTES = {"L1": 128.0, "L2": 64.0, "L3": 16.0, "memory": 4.0}


def record() -> dict:
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
            for name, rate in RATES.items():
                about = {"name": name, "precision": precision, "bits": bits, "unit": "flop/core cycle"}
                add(about, rate, bits / element * (2 if name == "fma" else 1))
    for level, value in BYTES.items():
        for name in ("load", "store", "copy"):
            for bits in (64, 128, 256, 512):
                about = {"name": name, "level": level, "bits": bits, "unit": "byte/core cycle"}
                about |= {"working_set_bytes": 1 << 14}
                add(about, value / (bits / 8) * bits / 256 * (1 if name == "copy" else 0.5), bits / 8)
    return {"schema": 1, "tsc_hz": 2.5e9, "core_hz": 4e9, "ceilings": rows}
