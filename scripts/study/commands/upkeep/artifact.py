"""Packs the last commit for its evaluation: one zip with a MANIFEST of SHA-256.

In it are sources, lock file, image recipe, scenes and published runs, as `git archive` gives them, in one
folder. One commit gives the same bytes on every day and in every checkout. docs/artifact.md is the guide for
whoever unpacks it. Sources that are not committed are not in it, and that is said.
"""

import argparse
import hashlib
import io
import stat
import tarfile
import zipfile
from pathlib import Path

from study.core import store
from study.core.cli import CANNOT_RUN, Outcome, StudyError
from study.core.host import checkout
from study.core.registry import ROOT

FOLDER = "stepwise"
MANIFEST = "MANIFEST"  # as sha256sum writes and checks it


def zipped(archive: tarfile.TarFile) -> bytes:
    """The files of an archive, and their MANIFEST. Order, times and rights are the same everywhere."""
    members = {one.name: one for one in sorted(archive, key=lambda one: one.name) if not one.isdir()}
    sums, made = "", io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as out:

        def put(name: str, mode: int, data: bytes) -> None:
            info = zipfile.ZipInfo(f"{FOLDER}/{name}")  # dated 1980: for no make in the future
            info.create_system, info.compress_type = 3, zipfile.ZIP_DEFLATED  # 3: Unix, whose rights follow
            info.external_attr = mode << 16
            out.writestr(info, data)

        for name, one in members.items():
            file = archive.extractfile(one)  # of a link: what it points at
            data = file.read() if file else b""
            sums += f"{hashlib.sha256(data).hexdigest()}  {name}\n"
            if one.issym():
                put(name, stat.S_IFLNK | 0o777, one.linkname.encode())
            else:
                put(name, stat.S_IFREG | (0o755 if one.mode & stat.S_IXUSR else 0o644), data)
        put(MANIFEST, stat.S_IFREG | 0o644, sums.encode())
    return made.getvalue()


def options(parser: argparse.ArgumentParser) -> None:
    out = ROOT / "build" / "stepwise-artifact.zip"
    about = "default: build/stepwise-artifact.zip"
    parser.add_argument("-o", "--out", type=Path, default=out, metavar="PATH", help=about)


def run(args: argparse.Namespace) -> Outcome:
    git = checkout.state()
    data, said = checkout.archive()
    if data is None or git.unknown:
        raise StudyError(f"an artifact is made of a git repository: {git.unknown or said}", CANNOT_RUN)
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        packed = zipped(archive)
    store.write_bytes(args.out, packed)
    digest = hashlib.sha256(packed).hexdigest()
    lines = [f"{args.out}: {len(packed) / 1e6:.1f} MB, commit {git.commit}", f"SHA-256 {digest}"]
    left = ["uncommitted changes are not in it"] if git.dirty else []
    found = {"file": args.out, "bytes": len(packed), "sha256": digest, "commit": git.commit}
    return Outcome(found, lines, remarks=left)
