"""ablations.json and ideas.json."""

from typing import Annotated, ClassVar

from study.core.schema import Record, key
from study.numbers.schema import Interval, Measured


class Row(Record, kw_only=True):
    """One patch on one scene, beside the program that it is compared with."""

    ablation: Annotated[str, key("", "phase+patch")]
    against: Annotated[str, key("", "the program without the patch, as a rule")]
    scene: Annotated[str, key("", "its name")]
    width: Annotated[int, key("pixels", "of the picture")] = 0
    height: Annotated[int, key("pixels", "of the picture")] = 0
    step: Annotated[str, key("", "`added` or `removed` by the patch")]
    what: Annotated[str, key("", "the step, from the patch's head")]
    idea: Annotated[str | None, key("", "the phase's idea that it takes out, from the head")] = None
    lines: Annotated[int | None, key("lines", "of the code that holds the idea, or of the patch")] = None
    paper: Annotated[str, key("", "what the paper says of it")]
    paper_value: Annotated[float | None, key("×", "its figure; null: none")] = None
    gain: Annotated[Interval, key("×", "time without the step over time with it")]
    claim: Annotated[str, key("", "whether the paper's figure holds here")] = ""
    ms: Annotated[Interval, key("ms", "of the patched program")]
    against_ms: Annotated[Interval, key("ms", "of the other")]
    reference: Annotated[str | None, key("", "whose picture the errors are to: baseline's or its own")] = None
    psnr_db: Annotated[float | None, key("dB", "linear RGB; null: infinite")]
    fraction_over_1_255: Annotated[float | None, key("share of pixels", "any channel off by over 1/255")]
    max_abs: Annotated[float | None, key("linear RGB", "largest difference")] = None
    mask_mismatch_ppm: Annotated[float | None, key("ppm", "hit against miss")] = None
    non_finite: Annotated[int, key("samples", "NaN or infinite where none may be")] = 0
    identical: Annotated[bool, key("", "equal bit for bit")] = False
    against_psnr_db: Annotated[float | None, key("dB", "of the other program")] = None
    change_psnr_db: Annotated[float | None, key("dB", "between the two pictures; null: equal")] = None
    change_max_abs: Annotated[float | None, key("linear RGB", "the same: largest difference")] = None
    verdict: Annotated[str, key("", "`identical`, `within`, `approximate` (declared) or `OUTSIDE`")]
    failed: Annotated[list[str], key("", "metrics outside of the tolerance")]
    error: Annotated[str | None, key("", "the error that the patch declares; null: none")] = None


class Counted(Record, kw_only=True):
    """One line of what a patch counts (`counts` in its head), of frames on one thread."""

    ablation: Annotated[str, key("", "phase+patch")]
    scene: Annotated[str, key("", "its name")]
    height: Annotated[int, key("pixels", "of the picture")]
    counts: Annotated[str, key("", "what the lines are, from the head")]
    name: Annotated[str, key("", "of the line")]
    share: Annotated[float, key("share of pixels", "that are of this line")]
    cycles: Annotated[Interval, key("core cycles", "over all pixels of the picture")]


class Reason(Record, kw_only=True):
    """A patch that was not measured."""

    ablation: Annotated[str, key("", "phase+patch")]
    reason: Annotated[str, key("", "why")]

    def __str__(self) -> str:
        return f"{self.ablation}: {self.reason}"


class Ablations(Measured, kw_only=True):
    """Single steps put in or taken out: gain and error."""

    made_by: ClassVar[str] = "ablations"
    reference: Annotated[str | None, key("", "baseline")] = None
    n: Annotated[int, key("pixels", "height of the pictures")] = 0
    rows: Annotated[list[Row], key("", "the steps")]
    skipped: Annotated[list[Reason], key("", "what cannot run here")]
    failures: Annotated[list[Reason], key("", "what crashed or did not build")]


class Ideas(Ablations, kw_only=True):
    """Each idea taken out of its phase, on the scenes that its patch names."""

    made_by: ClassVar[str] = "ablations --ideas"
    counted: Annotated[list[Counted], key("", "what patches count")] = []


FILE, IDEAS_FILE = "ablations.json", "ideas.json"
SCHEMAS = {FILE: Ablations, IDEAS_FILE: Ideas}
