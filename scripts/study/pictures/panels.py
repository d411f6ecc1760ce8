"""Figures made of pictures: heat maps with their colour bars, rows of panels, sheets. PNG."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.ticker import LogFormatter, LogLocator

from study.pictures import images
from study.pictures.images import Picture

GOOD, BAD, QUIET = "#1b1b1b", "#b3261e", "#6b6b6b"  # text: as it should be, outside its tolerance, absent
DIFFERENCE_LABEL = "largest difference of R, G, B\n(linear, in [0, 1]; log scale)"
MANY = 0.05  # of the pixels: a heat map with more of them speaks for itself
SMALLEST = 1e-6  # differences below it are drawn as none


def save(figure: Figure, path: Path) -> Path:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    images.write_png(path, np.asarray(canvas.buffer_rgba())[..., :3])
    return path


def two_rows(
    columns: int, size: tuple[float, float], title: str, top: float
) -> tuple[Figure, GridSpec, Axes]:
    """A sheet of two rows of pictures, a colour bar right of the lower one: figure, grid, the bar's axes.
    `size`: a column's width and the sheet's height, inches; `top`: where pictures end, of the height."""
    width = size[0] * columns + 1.1
    figure = Figure(figsize=(width, size[1]), dpi=100, facecolor="white")
    figure.suptitle(title, x=0.01, y=0.985, ha="left", va="top", fontsize=16)
    edges = {"left": 0.01, "right": 1 - 1.1 / width, "top": top, "bottom": 0.02}
    ratios = (*[1] * columns, 0.04)
    spots = figure.add_gridspec(2, columns + 1, wspace=0.03, hspace=0.12, width_ratios=ratios, **edges)
    return figure, spots, figure.add_subplot(spots[1, columns])


def show(axes: Axes, pixels: np.ndarray, **options):
    """A picture without ticks or frame. Small pictures keep their pixels, large ones are averaged."""
    smooth = pixels.shape[1] > axes.get_window_extent().width
    axes.set(xticks=[], yticks=[], frame_on=False)
    return axes.imshow(pixels, interpolation="antialiased" if smooth else "nearest", **options)


def difference(axes: Axes, bar_axes: Axes, reference: Picture, image: Picture) -> None:
    """Heat map of the largest difference of a pixel's channels, its colour bar in bar_axes."""
    linear = [images.rgb(p) for p in (reference, image)]
    off = np.abs(images.clamped(linear[0]) - images.clamped(linear[1])).max(axis=-1)
    off[~np.isfinite(linear[0] + linear[1]).all(axis=-1)] = np.nan
    # Averaging would dim single wrong pixels until they cannot be seen: take the largest of each block.
    off = block_max(off, math.ceil(off.shape[1] / axes.get_window_extent().width))
    colours = colormaps["inferno"].with_extremes(under="black", bad="cyan")
    drawn = show(axes, np.maximum(off, SMALLEST / 2), cmap=colours, norm=LogNorm(SMALLEST, 1))
    bar = axes.figure.colorbar(drawn, cax=bar_axes, extend="min")
    ticks = {1e-6: "10⁻⁶", 1e-5: "10⁻⁵", 1e-4: "10⁻⁴", 1e-3: "0.001", 0.1: "0.1", 1: "1"}
    bar.set_ticks([*ticks, images.ONE_STEP], labels=[*ticks.values(), "1/255"])
    bar.ax.axhline(images.ONE_STEP, color="white", linewidth=2)
    bar.set_label(DIFFERENCE_LABEL)
    cyan = ", cyan: not finite" if np.isnan(off).any() else ""
    axes.set_title(f"difference (black: less than 10⁻⁶{cyan})", fontsize=14, loc="left")


def tell(axes: Axes, reference: Picture, image: Picture) -> None:
    """Writes into a nearly black heat map how many pixels differ, and the largest difference."""
    off = np.abs(np.subtract(*(images.clamped(images.rgb(one)) for one in (reference, image)))).max(axis=-1)
    over = int((~(off <= SMALLEST)).sum())
    if over > MANY * off.size:
        return
    text = f"{over:,} of {off.size:,} pixels differ by over 10⁻⁶" if over else "no pixel differs by over 10⁻⁶"
    if np.isfinite(off).all():
        text += f"\nlargest difference: {off.max():.1g}"
    corner = {"transform": axes.transAxes, "ha": "left", "va": "bottom", "fontsize": 11, "color": "white"}
    axes.text(0.01, 0.015, text, bbox={"facecolor": "black", "edgecolor": "none", "alpha": 0.6}, **corner)


def block_max(plane: np.ndarray, factor: int) -> np.ndarray:
    """Largest value (NaN if there is one) of factor × factor blocks; the last ones may be smaller."""
    height, width = plane.shape
    padded = np.pad(plane, ((0, -height % factor), (0, -width % factor)), mode="edge")
    return padded.reshape(-(-height // factor), factor, -(-width // factor), factor).max(axis=(1, 3))


def error_text(metrics: dict) -> str:
    """PSNR, share over 1/255 and largest difference: what stands beside every speed."""
    if metrics["identical"]:
        return "identical, bit for bit"
    over, largest = 100 * metrics["fraction_over_1_255"], metrics["max_abs"]
    return f"PSNR {metrics['psnr_db']:.1f} dB, largest {largest:.2g}, {over:.3g} % of pixels over 1/255"


def sheet(
    title: str,
    tall: float,
    below: float,
    pictures: Mapping[str, Picture],
    notes: Sequence[str],
    right: float,
    more: Sequence[float] = (),
) -> tuple[Figure, list[Axes]]:
    """Pictures by their names and an empty panel in a row, notes under them, then panels of widths `more`.
    `tall`, `below`: inches of pictures and notes; `right`: where the row ends, of the width."""
    above = 0.9
    total = above + tall + below
    figure = Figure(figsize=(18.5, total), dpi=100, facecolor="white")
    figure.suptitle(title, x=0.01, y=1 - 0.15 / total, ha="left", va="top", fontsize=16)
    edges = {"top": 1 - above / total, "bottom": below / total, "left": 0.01, "right": right}
    widths = (1, 1, 1, *more)
    spots = figure.add_gridspec(1, len(widths), wspace=0.04, width_ratios=widths, **edges)
    axes = [figure.add_subplot(spots[0, i]) for i in range(len(widths))]
    for panel, (name, picture) in zip(axes, pictures.items(), strict=False):
        show(panel, images.to_display(images.rgb(picture)))
        panel.set_title(name, fontsize=14, loc="left")
    for panel, note in zip(axes, notes, strict=False):
        panel.set_xlabel(note, fontsize=12, loc="left", linespacing=1.4)
    return figure, axes


def pair(
    pictures: tuple[Picture, Picture],
    names: tuple[str, str],
    title: str,
    metrics: dict,
    notes: tuple[str, str, str],
    bad: bool = False,
) -> Figure:
    """Both pictures and their difference in a row, a note under each; under the last the error as well."""
    height, width = pictures[0]["R"].shape
    notes = notes[0], notes[1], f"{error_text(metrics)}\n{notes[2]}"
    below = 0.3 + 0.25 * max(note.count("\n") + 1 for note in notes)
    figure, (*axes, bar_axes) = sheet(
        title, 5.6 * height / width, below, dict(zip(names, pictures, strict=True)), notes, 0.945, (0.03,)
    )
    difference(axes[2], bar_axes, *pictures)
    axes[2].xaxis.label.set_color(BAD if bad else GOOD)
    return figure


def evaluations(planes: dict[str, np.ndarray], subject: str) -> Figure:
    """Heat maps of the distance evaluations of each camera ray, one panel a scene, one scale for all."""
    columns = min(3, len(planes))
    rows = -(-len(planes) // columns)
    top = max(2.0, max(float(np.nanmax(plane)) for plane in planes.values()))
    figure = Figure(
        figsize=(4.6 * columns + 1.5, 3.0 * rows + 0.7), dpi=110, layout="constrained", facecolor="white"
    )
    figure.suptitle(f"Distance evaluations per pixel: {subject}", fontsize=15)
    axes = figure.subplots(rows, columns, squeeze=False)
    for panel in axes.flat[len(planes) :]:
        panel.set_axis_off()
    for panel, (name, plane) in zip(axes.flat, planes.items(), strict=False):
        drawn = show(panel, plane, cmap="viridis", norm=LogNorm(1, top))
        panel.set_title(name, fontsize=13)
        mean, most = float(np.nanmean(plane)), float(np.nanmax(plane))
        panel.set_xlabel(f"mean {mean:.1f}, median {np.nanmedian(plane):.0f}, most {most:.0f}", fontsize=11)
    bar = figure.colorbar(drawn, ax=axes, fraction=0.03, pad=0.01)
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    bar.ax.yaxis.set_major_formatter(LogFormatter(labelOnlyBase=False, minor_thresholds=(np.inf, np.inf)))
    bar.set_label("distance evaluations of the camera ray (logarithmic)", fontsize=12)
    return figure
