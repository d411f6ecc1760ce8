"""What a core's ports allow: FMAs issued per core cycle, by microarchitecture and width of the vector.

Beside a measured ceiling this is the theoretical peak: ports × lanes × 2. Sources: Intel 64 and IA-32
Architectures Optimization Reference Manual (ports of each core); A. Fog, "The microarchitecture of Intel, AMD
and VIA CPUs" (agner.org/optimize); A. Abel, J. Reineke, "uops.info", ASPLOS 2019; Arm's Software Optimization
Guides of the Neoverse cores (ASIMD FP multiply accumulate).

Left out is what a name does not settle: 512 bits on Skylake, Cascade Lake and Ice Lake (one unit or two, by
product) and on Zen 5 (256 bits wide in the mobile ones); hybrids, where it depends on the core; CPUs
without FMA.
"""

import math

from study.core import machine
from study.core.run_schema import Cpu

ELEMENT = {"double": 64, "single": 32}  # bits
WIDE, WIDER = {128: 2, 256: 2}, {128: 2, 256: 2, 512: 2}  # two units, of 256 bits and of 512
ONE = {128: 2, 256: 2, 512: 1}  # two of 256 bits that are one of 512
TWO, FOUR = {128: 2}, {128: 4}  # units of 128 bits
PORTS: dict[str, dict[int, int]] = {
    **dict.fromkeys(("Haswell", "Broadwell", "Skylake", "Cascade Lake", "Cooper Lake"), WIDE),
    **dict.fromkeys(("Kaby Lake", "Comet Lake", "Ice Lake"), WIDE),
    **dict.fromkeys(("Tiger Lake", "Rocket Lake"), ONE),
    **dict.fromkeys((*machine.AMX, machine.SOME_AMX), WIDER),
    "Zen": {128: 2, 256: 1},  # 256 bits are two operations
    **dict.fromkeys(("Zen 2", "Zen 3", "Zen 5"), WIDE),
    "Zen 4": ONE,
    **dict.fromkeys(("Neoverse N1", "Neoverse N2"), TWO),
    **dict.fromkeys(("Neoverse V1", "Neoverse V2"), FOUR),
}
# Operations of one instruction's lane; additions and multiplications have as many ports at most.
FLOPS = {"fma": 2, "add": 1, "mul": 1}


def widest(cpu: Cpu) -> int:
    """Bits of the widest register that the phases use: arm64's vectors have 128."""
    return 128 if "asimd" in cpu.flags else 512


def peak(cpu: Cpu | None, kind: str, precision: str, bits: int) -> float:
    """Flop per core cycle at most, of fma, add or mul; NaN where that is not known. `bits`: the element's
    where scalar."""
    several = PORTS.get((cpu and cpu.microarchitecture) or "", {}).get(max(bits, 128))
    if several is None or kind not in FLOPS:
        return math.nan
    return float(several * (bits // ELEMENT[precision]) * FLOPS[kind])
