"""Pictures as data URIs, in the form of fewest bytes that shows them well."""

from __future__ import annotations

import base64
import io

from PIL import Image

MIME = {"png": "image/png", "svg": "image/svg+xml", "jpeg": "image/jpeg", "webp": "image/webp"}
SHORTER = 0.6  # a JPEG stands in for a rendered picture where it has at most this share of its bytes
QUALITY = 85
WIDEST = 2000  # pixels of a rendered picture on the page: twice what a column shows; its file has all of them


def data_uri(content: bytes, kind: str) -> str:
    return f"data:{MIME[kind]};base64,{base64.b64encode(content).decode()}"


def exact(png: bytes) -> str:
    """The same pixels: as lossless WebP where that is shorter."""
    made = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").save(made, format="webp", lossless=True, method=4)
    return data_uri(made.getvalue(), "webp") if made.tell() < len(png) else data_uri(png, "png")


def rendered(png: bytes) -> str:
    """The same pixels, or nearly so where a JPEG is much shorter; at most WIDEST of them across."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    if picture.width > WIDEST:
        picture = picture.resize((WIDEST, round(picture.height * WIDEST / picture.width)))
        smaller = io.BytesIO()
        picture.save(smaller, format="png")
        png = smaller.getvalue()
    made = io.BytesIO()
    picture.save(made, format="jpeg", quality=QUALITY, optimize=True)
    same = exact(png)
    short = data_uri(made.getvalue(), "jpeg")
    return short if len(short) <= SHORTER * len(same) else same
