"""Pictures as data URIs, in the form of fewest bytes that shows them well."""

import base64
import io

from PIL import Image

COLOURS = 128  # of a figure: no channel of any pixel is more than some 20 of 255 off
QUALITY = 88
WIDEST = 2000  # pixels of a rendered picture on the page: twice what a column shows; its file has all of them


def data_uri(content: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"


def _webp(picture: Image.Image, **how: int) -> str:
    made = io.BytesIO()
    picture.convert("RGB").save(made, format="webp", method=4, **how)
    return data_uri(made.getvalue(), "webp")


def exact(picture: Image.Image) -> str:
    return _webp(picture, lossless=True)


def figure(png: bytes) -> str:
    """A drawn figure, of fewer colours."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    return exact(picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE))


def rendered(png: bytes) -> str:
    """Nearly the same pixels; at most WIDEST of them across."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    picture.thumbnail((WIDEST, picture.height))
    return _webp(picture, quality=QUALITY)
