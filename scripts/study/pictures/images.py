"""Pictures: float EXR in, the metrics of the equivalence gate, PNG out.

Metrics, units and their order are those of study/numbers/schema.py. A picture has float32 planes (height ×
width), one per EXR channel: R G B (linear, not clamped) and, rendered with --aov, Z id N.x N.y N.z evals.
"""

from __future__ import annotations

import hashlib
import io
import math
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from PIL import Image

from study.core import store
from study.core.cli import StudyError

try:
    import flip_evaluator
except ImportError:  # no wheel for Python 3.14, none for arm64: pictures are judged without
    flip_evaluator = None

AOVS = ("R", "G", "B", "Z", "id", "N.x", "N.y", "N.z", "evals")
GAMMA = 0.4545
ONE_STEP = 1 / 255  # of 8 bits: what a pixel may be off by before it counts
DEPTH_AGREES = 1e-3  # relative; see depth_agree_fraction
# OpenImageIO has FLIP too, but it may fail for want of a colour space in the default configuration.
HAS_FLIP = flip_evaluator is not None
FLIP_TOOL = (
    f"flip-evaluator {version('flip-evaluator')}, LDR, display pictures, default viewing distance"
    if HAS_FLIP
    else "none: FLIP has no wheel for this machine or Python, its bounds are not checked"
)

PICTURE_TOOL = f"OpenImageIO {oiio.VERSION_STRING} ImageBufAlgo.compare"


class Picture(dict[str, np.ndarray]):
    """Planes by name; those whose names are words are attributes too: `picture.id`."""

    def __getattr__(self, name: str) -> np.ndarray:
        if name in self:
            return self[name]
        raise AttributeError(f"the picture has no plane {name}")

    def __or__(self, other: Mapping[str, np.ndarray]) -> Picture:  # type: ignore[override]
        return Picture({**self, **other})

    @property
    def chain(self) -> np.ndarray:
        """Truth's status of the pixel's whole chain of rays."""
        return self["status.all"]

    @property
    def hit(self) -> np.ndarray:
        """A pixel with a NaN, or with a depth where there is no shape, is neither a hit nor a miss."""
        return (self.id >= 0) & np.isfinite(self.Z)

    @property
    def miss(self) -> np.ndarray:
        return (self.id == -1) & (np.inf == self.Z)

    def where(self, mask: np.ndarray) -> Picture:
        """Its pixels where `mask` holds, of the planes of a phase's picture."""
        return Picture({name: self[name][mask] for name in AOVS})


def _read(path: Path | str, kind: str) -> tuple[oiio.ImageSpec, np.ndarray]:
    """Head and samples, height × width × channels. Raises StudyError for what is no whole picture."""
    file = oiio.ImageInput.open(str(path))
    if file is None:
        raise StudyError(f"{path}: not a readable picture: {oiio.geterror()}")
    try:
        samples = file.read_image(kind)
        if samples is None:
            raise StudyError(f"{path}: not a whole picture: {file.geterror()}")
        return file.spec(), samples
    finally:
        file.close()


def read(path: Path | str) -> Picture:
    """Every channel of an EXR, by name. Raises StudyError if it is no picture."""
    spec, samples = _read(path, "float")
    planes = enumerate(spec.channelnames)
    return Picture({name: np.ascontiguousarray(samples[..., i]) for i, name in planes})


def read_ppm(path: Path) -> np.ndarray:
    """Height × width × 3 bytes, of what `render --display` writes. Raises StudyError of another file."""
    try:
        kind, size, most, samples = path.read_bytes().split(b"\n", 3)
        width, height = map(int, size.split())
        if (kind, most) == (b"P6", b"255"):
            return np.frombuffer(samples, np.uint8).reshape(height, width, 3)
    except OSError as error:
        raise StudyError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError:
        pass
    raise StudyError(f"{path}: not a whole binary PPM of 8 bits")


def read_png(path: Path) -> np.ndarray:
    """Height × width × 3 bytes of a PNG, without its alpha. Raises StudyError of another file."""
    return _read(path, "uint8")[1][:, :, :3]


def rgb(picture: Picture, prefix: str = "") -> np.ndarray:
    """Linear colour of the planes `prefix`R, G and B, height × width × 3."""
    return np.stack([picture[prefix + name] for name in "RGB"], axis=-1)


def clamped(linear: np.ndarray) -> np.ndarray:
    """What a viewer can see of a linear colour. NaN stays NaN."""
    return np.clip(linear, 0, 1)


def to_display(linear: np.ndarray) -> np.ndarray:
    """Gamma and 8 bits as the driver presents: trunc(255·min(1, c^0.4545)), 0 for negatives and NaN."""
    positive = np.where(linear > 0, linear, 0).astype(np.float64)
    return (255 * np.minimum(1, positive**GAMMA)).astype(np.uint8)


def box_average(linear: np.ndarray, factor: int) -> np.ndarray:
    """Mean of the clamped colours of factor × factor blocks; a remainder at the right and bottom is cut off.
    Samples are clamped before: it is what the eye makes of the picture from afar. NaN in a block with a
    sample that is not finite."""
    height, width = (size // factor for size in linear.shape[:2])
    used = linear[: height * factor, : width * factor]
    blocks = np.where(np.isfinite(used), clamped(used), np.nan).astype(np.float64)
    return blocks.reshape(height, factor, width, factor, 3).mean(axis=(1, 3)).astype(np.float32)


def write_png(path: Path, rgb8: np.ndarray) -> None:
    """Writes height × width × 3 bytes, whole or not at all. Raises StudyError. Made in memory: OpenImageIO
    says that it has written a file where the disk is full."""
    made = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(rgb8, np.uint8)).save(made, "png")
    store.write_bytes(path, made.getvalue())


def sha256(picture: Picture) -> str:
    """Hash of names, size and every bit of every channel (−0 is not 0, one NaN not another)."""
    digest = hashlib.sha256()
    for name in sorted(picture):
        digest.update(f"{name} {picture[name].shape}".encode())
        digest.update(picture[name].astype("<f4", copy=False).tobytes())
    return digest.hexdigest()


def non_finite(picture: Picture) -> int:
    """Samples that are NaN or infinite. Z = +inf is right where nothing was hit (id −1), and only there. NaN
    is right as truth's colour of an exact surface that is undecided."""
    count = 0
    for name, plane in picture.items():
        bad = ~np.isfinite(plane)
        if name.endswith("Z"):
            bad &= ~((plane == np.inf) & (picture[f"{name[:-1]}id"] == -1))
        elif name.startswith("surface.") and name[-1] in "RGB":
            bad &= ~np.isnan(plane)
        count += int(bad.sum())
    return count


def metrics(
    reference: np.ndarray, image: np.ndarray, threshold: float, peak: float
) -> tuple[float, float, float]:
    """PSNR in dB, RMSE as a share of peak, share of pixels with any channel off by more than threshold. NaN
    where a sample is not finite: OpenImageIO calls such pictures equal."""
    if not (np.isfinite(reference).all() and np.isfinite(image).all()):
        return math.nan, math.nan, math.nan
    a, b = (oiio.ImageBuf(np.ascontiguousarray(x, np.float32)) for x in (reference, image))
    found = oiio.ImageBufAlgo.compare(a, b, threshold, threshold)
    rmse = found.rms_error / peak
    psnr = math.inf if rmse == 0 else -20 * math.log10(rmse)
    return psnr, rmse, found.nfail / (reference.shape[0] * reference.shape[1])


def flip(reference8: np.ndarray, image8: np.ndarray, judged: np.ndarray | None = None) -> tuple[float, float]:
    """Mean and maximum of FLIP between two display pictures (Andersson et al. 2020), where judged."""
    if np.array_equal(reference8, image8):
        return 0.0, 0.0  # by definition, and it is most of the gate's time
    a, b = (x.astype(np.float32) / 255 for x in (reference8, image8))
    error, _, _ = flip_evaluator.evaluate(
        a, b, "LDR", inputsRGB=True, applyMagma=False, computeMeanError=False
    )
    shown = error if judged is None else error.reshape(judged.shape)[judged]
    return float(shown.mean(dtype=np.float64)), float(shown.max())


def _percentile(values: np.ndarray, share: float, any_hit: bool) -> float:
    """Percentile; without a pixel 0 if both pictures are empty, else NaN, which no tolerance lets pass."""
    return float(np.percentile(values, share)) if values.size else math.nan if any_hit else 0.0


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Degrees between normals, count × 3; 180 where one has no length, and so no direction to agree with."""
    # atan2 keeps its digits at small angles, where acos of the dot product has none left.
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1)))
    unit = np.all([np.abs(np.linalg.norm(n, axis=-1) - 1) < 1e-3 for n in (a, b)], axis=0)
    return np.where(unit, angle, 180.0)


def geometry(reference: Picture, image: Picture) -> dict[str, float]:
    """Hit mask, shapes, hit distances and normals: the errors below the picture. Planes of any shape."""
    both = reference.hit & image.hit
    agree = both | (reference.miss & image.miss)  # what is neither agrees with nothing
    same = both & (reference.id == image.id)
    z_a, z_b = (np.where(both, p.Z, 0).astype(np.float64) for p in (reference, image))
    dt, pixels = np.abs(z_a - z_b), both.size
    any_hit = bool((~reference.miss | ~image.miss).any())

    a, b = (
        np.stack([p[n][same] for n in ("N.x", "N.y", "N.z")], -1).astype(np.float64)
        for p in (reference, image)
    )
    angle = angles(a, b)
    return {
        "mask_mismatch_ppm": 1e6 * float((~agree).sum()) / pixels,
        "id_mismatch_ppm": 1e6 * float((both & ~same).sum()) / pixels,
        "dt_p99": _percentile(dt[same], 99, any_hit),
        "dt_max": _percentile(dt[same], 100, any_hit),
        "normal_p99_degrees": _percentile(angle, 99, any_hit),
        "depth_agree_fraction": float((agree & (dt <= DEPTH_AGREES * z_a)).sum()) / pixels,
    }


def of_judged(judged: np.ndarray, psnr: float, rmse: float, over: float) -> tuple[float, float, float]:
    """PSNR in dB, RMSE, share of pixels: of the judged ones (height × width), where all others are equal."""
    share = float(judged.mean())
    if share in (0, 1):
        return (psnr, rmse, over) if share else (math.nan,) * 3
    return psnr + 10 * math.log10(share), rmse / math.sqrt(share), over / share


def colour_errors(
    reference: np.ndarray, image: np.ndarray, with_flip: bool = True, judged: np.ndarray | None = None
) -> dict[str, float]:
    """The picture metrics of two linear colours (height × width × 3), in linear and in display space.
    `judged`: height × width, the pixels that they are of, else all. Of no pixel all are NaN."""
    judged = np.ones(reference.shape[:2], bool) if judged is None else judged
    linear = [np.where(judged[..., None], x, 0) for x in (reference, image)]
    finite = all(np.isfinite(x).all() for x in linear)
    # Infinity would look like 1 once clamped, so a picture that is not finite has no picture metrics.
    psnr, rmse, over = metrics(*map(clamped, linear), ONE_STEP, 1.0) if finite else (math.nan,) * 3
    display = [to_display(x) for x in linear]
    psnr8, rmse8, over8 = metrics(*display, 1.0, 255.0) if finite else (math.nan,) * 3
    psnr, rmse, over = of_judged(judged, psnr, rmse, over)
    psnr8, _, over8 = of_judged(judged, psnr8, rmse8, over8)
    found = {
        "psnr_db": psnr,
        "rmse": rmse,
        "fraction_over_1_255": over,
        "max_abs": float(np.abs(linear[0] - linear[1]).max()) if finite and judged.any() else math.nan,
        "psnr_display_db": psnr8,
        "fraction_over_1_255_display": over8,
    }
    if with_flip and HAS_FLIP:
        none = math.nan, math.nan
        found["flip_mean"], found["flip_max"] = flip(*display, judged) if finite and judged.any() else none
    return found


def antialiased(reference: Picture, image: Picture, factor: int = 4) -> dict[str, float]:
    """The picture metrics after box averaging, for scenes where one sample per pixel is chaotic."""
    a, b = (box_average(rgb(p), factor) for p in (reference, image))
    psnr, rmse, over = metrics(a, b, ONE_STEP, 1.0)
    bad = non_finite(reference) + non_finite(image)
    return {"non_finite": bad, "psnr_db": psnr, "rmse": rmse, "fraction_over_1_255": over}


def compare(reference: Picture, image: Picture, large: tuple[Picture, Picture] | None = None) -> dict:
    """Every metric of the gate, in its order. `large`: both at four times the size, to be averaged. NaN
    stands for a metric that has no value: no tolerance lets it pass. Raises StudyError for pictures of unlike
    form."""
    bad = non_finite(reference) + non_finite(image)
    hashes = sha256(reference), sha256(image)
    return {
        "non_finite": bad,
        "identical": hashes[0] == hashes[1],
        "reference_sha256": hashes[0],
        "sha256": hashes[1],
        **geometry(reference, image),
        **colour_errors(rgb(reference), rgb(image)),
        **({"antialiased": antialiased(*large)} if large else {}),
    }
