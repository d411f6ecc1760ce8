#!/usr/bin/env python3
"""Writes the page of `make web`: one file with its scripts, scenes and WebAssembly modules (web.mk).

    build.py BUILD OUT PHASE...

Standard library only. What the page unpacks is gzip in base64.
"""

import base64
import gzip
import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MOST = 3_000_000  # bytes of the page


def packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def embedded(name: str, data: bytes) -> str:
    """Returns an element with data that no browser runs."""
    return f'<script type="text/plain" id="{name}">{packed(data)}</script>'


def scenes() -> dict[str, str]:
    """Returns the texts of common/scenes by name, plain scenes first."""
    folder = ROOT / "common" / "scenes"
    return {
        path.stem: path.read_text()
        for path in [*sorted(folder.glob("*.json")), *sorted(folder.glob("*/*.json"))]
    }


def main() -> None:
    build, out, names = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]
    web = ROOT / "web"
    about = []
    for name in names:
        info = json.loads((ROOT / "phases" / name / "phase.json").read_text())
        about.append({"name": name, "title": info["title"]})
    parts = {
        "STYLE": (web / "page.css").read_text(),
        "ABOUT": json.dumps(about),
        "WORKER": (web / "worker.js").read_text(),
        "SCRIPT": (web / "page.js").read_text(),
        "DATA": "\n".join(
            [
                embedded("scenes", json.dumps(scenes()).encode()),
                *(embedded(name, (build / name / "module.wasm").read_bytes()) for name in names),
            ]
        ),
    }
    page = (web / "page.html").read_text()
    for key, text in parts.items():
        page = page.replace("{{" + key + "}}", text)
    if len(page.encode()) > MOST:
        sys.exit(f"build.py: the page has {len(page.encode()):,} bytes; at most {MOST:,} are allowed")
    temporary = out.with_suffix(".tmp")
    try:
        temporary.write_text(page)
        temporary.rename(out)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        sys.exit(f"build.py: {out}: cannot be written: {error.strerror}")
    print(f"make web: {out}, {len(page.encode()) / 1e6:.2f} MB; open it in a browser")


if __name__ == "__main__":
    main()
