"""ablations.json and ideas.json."""

from __future__ import annotations

from typing import Annotated, ClassVar

from study.core.schema import ABSENT, Absent, Record, key
from study.numbers.schema import Interval, Measured


class Flops(Record, kw_only=True):
    """FLOPs of one frame, by two conventions (docs/method.md)."""

    machine: Annotated[int, key("FLOP", "the machine's")]
    paper: Annotated[int | Absent, key("FLOP", "the paper's; absent where they were measured")] = ABSENT


class Row(Record, kw_only=True):
    """One patch on one scene, beside the program that it is compared with."""

    ablation: Annotated[str, key("", "phase+patch")]
    against: Annotated[str, key("", "the program without the patch, as a rule")]
    scene: Annotated[str, key("", "its name")]
    width: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    height: Annotated[int | Absent, key("pixels", "of the picture")] = ABSENT
    step: Annotated[str, key("", "`added` or `removed` by the patch")]
    what: Annotated[str, key("", "the step, from the patch's head")]
    idea: Annotated[str | Absent | None, key("", "the phase's idea that it takes out, from the head")] = (
        ABSENT
    )
    lines: Annotated[
        int | Absent | None, key("lines", "of the code that holds the idea, or of the patch")
    ] = ABSENT
    paper: Annotated[str, key("", "what the paper says of it")]
    paper_value: Annotated[float | Absent | None, key("×", "its figure; null: none")] = ABSENT
    gain: Annotated[Interval, key("×", "time without the step over time with it")]
    claim: Annotated[str | Absent, key("", "whether the paper's figure holds here")] = ABSENT
    ms: Annotated[Interval, key("ms", "of the patched program")]
    against_ms: Annotated[Interval, key("ms", "of the other")]
    reference: Annotated[
        str | Absent,
        key("", "whose picture the errors are to: baseline's, or the phase's own if truth judges it"),
    ] = ABSENT
    psnr_db: Annotated[float | None, key("dB", "linear RGB; null: infinite")]
    fraction_over_1_255: Annotated[float | None, key("share of pixels", "any channel off by over 1/255")]
    max_abs: Annotated[float | Absent | None, key("linear RGB", "largest difference")] = ABSENT
    mask_mismatch_ppm: Annotated[float | Absent | None, key("ppm", "hit against miss")] = ABSENT
    non_finite: Annotated[int | Absent, key("samples", "NaN or infinite where none may be")] = ABSENT
    identical: Annotated[bool | Absent, key("", "equal bit for bit")] = ABSENT
    against_psnr_db: Annotated[float | Absent | None, key("dB", "of the other program")] = ABSENT
    change_psnr_db: Annotated[
        float | Absent | None, key("dB", "between the pictures of the two programs; null: equal")
    ] = ABSENT
    change_max_abs: Annotated[float | Absent | None, key("linear RGB", "the same: largest difference")] = (
        ABSENT
    )
    verdict: Annotated[
        str, key("", "`identical`, `within` its tolerance, `approximate` (declared) or `OUTSIDE`")
    ]
    failed: Annotated[list[str], key("", "metrics outside of the tolerance")]
    error: Annotated[str | Absent | None, key("", "the error that the patch declares; null: none")] = ABSENT
    flops_by: Annotated[str | Absent | None, key("", "who counted")] = ABSENT
    flops: Annotated[Flops | Absent | None, key("", "of the patched program")] = ABSENT
    against_flops: Annotated[Flops | Absent | None, key("", "of the other")] = ABSENT
    flops_ratio: Annotated[float | Absent | None, key("×", "machine FLOPs with the step over without")] = (
        ABSENT
    )


class Reason(Record, kw_only=True):
    """A patch that was not measured."""

    ablation: Annotated[str, key("", "phase+patch")]
    reason: Annotated[str, key("", "why")]


class Ablations(Measured, kw_only=True):
    """Single steps put in or taken out: gain, error, FLOPs."""

    made_by: ClassVar[str] = "ablations"
    reference: Annotated[str | Absent, key("", "baseline")] = ABSENT
    n: Annotated[int | Absent, key("pixels", "height of the pictures")] = ABSENT
    rows: Annotated[list[Row], key("", "the steps")]
    skipped: Annotated[list[Reason], key("", "what cannot run here")]
    failures: Annotated[list[Reason], key("", "what crashed or did not build")]


class Ideas(Ablations, kw_only=True):
    """Each idea taken out of its phase, on the scenes that its patch names."""

    made_by: ClassVar[str] = "ideas"


SCHEMAS = {"ablations.json": Ablations}
IDEAS = {"ideas.json": Ideas}
