"""Pictures as data URIs, in the form of fewest bytes that shows them well."""

from __future__ import annotations

import base64
import io

from PIL import Image

MIME = {"png": "image/png", "svg": "image/svg+xml", "jpeg": "image/jpeg", "webp": "image/webp"}
SHORTER = 0.6  # a JPEG stands in for a rendered picture where it has at most this share of its bytes
QUALITY = 85


def data_uri(content: bytes, kind: str) -> str:
    return f"data:{MIME[kind]};base64,{base64.b64encode(content).decode()}"


def exact(png: bytes) -> str:
    """The same pixels: as lossless WebP where that is shorter."""
    made = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").save(made, format="webp", lossless=True, method=4)
    return data_uri(made.getvalue(), "webp") if made.tell() < len(png) else data_uri(png, "png")


def rendered(png: bytes) -> str:
    """The same pixels, or nearly so where a JPEG is much shorter."""
    made = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").save(made, format="jpeg", quality=QUALITY, optimize=True)
    same = exact(png)
    short = data_uri(made.getvalue(), "jpeg")
    return short if len(short) <= SHORTER * len(same) else same
