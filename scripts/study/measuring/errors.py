"""How far a picture is from ground truth's, or from another that stands for it."""

from __future__ import annotations

from typing import Any

from study.core import cli
from study.core.schema import Record
from study.pictures import images
from study.pictures.images import Picture
from study.truth import judging

FACTOR = judging.FACTOR
Errors = dict[str, Any]  # keys of PictureErrors


def to_truth(exact: Picture, image: Picture) -> Errors:
    """`wrong_ppm` is of the pixels that truth proves, PSNR of the colours that it knows. With the errors to
    the ideal shadow."""
    found = judging.metrics(exact, image)
    kept = {name: found[name] for name in ("psnr_db", "rmse", "psnr_ideal_db", "rmse_ideal", "non_finite")}
    wrong = sum(found[f"{name}_ppm"] for name in ("false_hits", "false_misses", "wrong_shape"))
    return cli.plain(kept | {"wrong_ppm": wrong})


def to_picture(reference: Picture, image: Picture, fractal: bool = False) -> Errors:
    """Of a fractal's 4×4 means, as its single samples are chaotic."""
    base, own = images.rgb(reference), images.rgb(image)
    if fractal:
        base, own = images.box_average(base, FACTOR), images.box_average(own, FACTOR)
    colours = images.colour_errors(base, own, with_flip=False)
    geometry = images.geometry(reference, image)
    return cli.plain(
        {
            **{name: colours[name] for name in ("psnr_db", "rmse", "fraction_over_1_255")},
            "averaged": fractal,
            "wrong_ppm": geometry["mask_mismatch_ppm"] + geometry["id_mismatch_ppm"],
            "depth_agree_fraction": geometry["depth_agree_fraction"],
            "non_finite": images.non_finite(image),
        }
    )


def fitting(kind: type[Record], found: Errors) -> Errors:
    """What of the errors a row of that kind has a key for."""
    return {name: value for name, value in found.items() if name in kind.__struct_fields__}
