"""The cores of arm64: who made one and what it is, from the numbers of /proc/cpuinfo.

Numbers: Linux, arch/arm64/include/asm/cputype.h; Arm Architecture Reference Manual, DDI 0487, MIDR_EL1.
"""

from collections.abc import Mapping

from study.core.run_schema import Cpu

ARMV8 = 8  # "CPU architecture" of every 64-bit core
MAKERS = {
    **{0x41: "Arm", 0x43: "Cavium", 0x46: "Fujitsu", 0x48: "HiSilicon", 0x4E: "NVIDIA", 0x50: "APM"},
    **{0x51: "Qualcomm", 0x61: "Apple", 0x6D: "Microsoft", 0xC0: "Ampere"},
}
PARTS = {
    **{(0x41, 0xD03): "Cortex-A53", (0x41, 0xD05): "Cortex-A55", (0x41, 0xD07): "Cortex-A57"},
    **{(0x41, 0xD08): "Cortex-A72", (0x41, 0xD09): "Cortex-A73", (0x41, 0xD0A): "Cortex-A75"},
    **{(0x41, 0xD0B): "Cortex-A76", (0x41, 0xD0D): "Cortex-A77", (0x41, 0xD41): "Cortex-A78"},
    **{(0x41, 0xD44): "Cortex-X1", (0x41, 0xD46): "Cortex-A510", (0x41, 0xD47): "Cortex-A710"},
    **{(0x41, 0xD48): "Cortex-X2", (0x41, 0xD4D): "Cortex-A715", (0x41, 0xD4E): "Cortex-X3"},
    **{(0x41, 0xD80): "Cortex-A520", (0x41, 0xD81): "Cortex-A720", (0x41, 0xD82): "Cortex-X4"},
    **{(0x41, 0xD0C): "Neoverse N1", (0x41, 0xD49): "Neoverse N2", (0x41, 0xD8E): "Neoverse N3"},
    **{(0x41, 0xD40): "Neoverse V1", (0x41, 0xD4F): "Neoverse V2", (0x41, 0xD84): "Neoverse V3"},
    **{(0x43, 0x0AF): "ThunderX2", (0x46, 0x001): "A64FX", (0x48, 0xD01): "Kunpeng 920"},
    **{(0x51, 0x001): "Oryon", (0x6D, 0xD49): "Azure Cobalt 100"},
    **{(0xC0, 0xAC3): "Ampere-1", (0xC0, 0xAC4): "Ampere-1a"},
    **{(0x61, 0x022): "M1 Icestorm", (0x61, 0x024): "M1 Icestorm", (0x61, 0x028): "M1 Icestorm"},
    **{(0x61, 0x023): "M1 Firestorm", (0x61, 0x025): "M1 Firestorm", (0x61, 0x029): "M1 Firestorm"},
    **{(0x61, 0x032): "M2 Blizzard", (0x61, 0x034): "M2 Blizzard", (0x61, 0x038): "M2 Blizzard"},
    **{(0x61, 0x033): "M2 Avalanche", (0x61, 0x035): "M2 Avalanche", (0x61, 0x039): "M2 Avalanche"},
    (0x61, 0x000): "Apple silicon",  # in a virtual machine, which hides the part
}


def block(text: str, cpu: int) -> dict[str, str]:
    """What /proc/cpuinfo says of `cpu`, or of the first one without it: cores may be of several kinds."""
    blocks = []
    for part in text.split("\n\n"):
        lines = (line.partition(":") for line in part.splitlines())
        blocks.append({key.strip(): value.strip() for key, _, value in lines})
    return next((one for one in blocks if one.get("processor") == str(cpu)), blocks[0])


def number(info: Mapping[str, str], key: str) -> int:
    """A number of /proc/cpuinfo, decimal or 0x…; 0 for what is none."""
    try:
        return int(info.get(key, ""), 0)
    except ValueError:
        return 0


def named(info: Mapping[str, str]) -> Cpu:
    """The core of a block: `stepping` is variant and revision, so r3p1 is 0x31."""
    maker, part = number(info, "CPU implementer"), number(info, "CPU part")
    vendor, core = MAKERS.get(maker, f"maker {maker:#04x}"), PARTS.get((maker, part))
    model = core or f"part {part:#05x}"
    return Cpu(
        model=model if model.startswith(vendor) else f"{vendor} {model}",
        vendor=vendor,
        family=number(info, "CPU architecture"),
        model_number=part,
        stepping=number(info, "CPU variant") << 4 | number(info, "CPU revision"),
        microarchitecture=core,
        flags=info.get("Features", "").split(),
    )
