"""scripts/setup.sh with a stand-in apt-get: what it asks for, and what it remembers. Nothing is installed."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = (
    *("sh", "dirname", "mkdir", "flock", "grep", "cut", "cat", "rm", "id", "tail", "sha256sum", "env", "gcc"),
    *("make", "pkg-config", "uname", "cp", "mv", "sed", "awk", "head", "df", "du"),
)
PYTHON = os.path.realpath(sys.executable)  # which("python3") may be a script that asks what it stands for
# In another language than English; status 0 unless it is told that an error is one, as apt-get does.
UNREACHABLE = """echo 'W: Fehlschlag beim Holen von http://deb.example/InRelease'
case "$*" in *APT::Update::Error-Mode=any*) exit 100 ;; esac"""
CUT_OFF = "echo 'E: Fehlschlag beim Holen von http://deb.example/perf.deb'; exit 100"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A tree where all is there but perf and llvm-mca, and a PATH and headers of its own: bin/, include/."""
    (tmp_path / "scripts").mkdir()
    shutil.copy(ROOT / "scripts" / "setup.sh", tmp_path / "scripts")
    (tmp_path / "bin").mkdir()
    for tool in TOOLS:
        found = shutil.which(tool)
        assert found, tool
        (tmp_path / "bin" / tool).symlink_to(found)
    (tmp_path / "bin" / "python3").symlink_to(PYTHON)
    (tmp_path / "include" / "embree3").mkdir(parents=True)
    (tmp_path / "include" / "embree3" / "rtcore.h").touch()
    (tmp_path / "requirements.lock").write_text("")
    venv(tmp_path)
    (tmp_path / ".venv" / ".installed-from").write_text(hashlib.sha256(b"").hexdigest())
    for name in ("sudo", "apt-cache"):
        command(tmp_path, name, 'shift; exec "$@"' if name == "sudo" else "exit 0")
    return tmp_path


def venv(tree: Path) -> Path:
    """An environment with a numpy and a pip that do nothing; where they are."""
    packages = tree / ".venv" / "lib" / f"python3.{sys.version_info.minor}" / "site-packages"
    packages.mkdir(parents=True)
    for name in ("numpy", "pip"):
        (packages / f"{name}.py").touch()
    (tree / ".venv" / "bin").mkdir()
    (tree / ".venv" / "bin" / "python").symlink_to(PYTHON)
    (tree / ".venv" / "pyvenv.cfg").write_text(f"home = {Path(PYTHON).parent}\n")
    return packages


def command(tree: Path, name: str, body: str) -> None:
    (tree / "bin" / name).write_text(f"#!/bin/sh\n{body}\n")
    (tree / "bin" / name).chmod(0o755)


def ends(tree: Path, script: str = "", **environment: str) -> tuple[int, str, str]:
    """Status, standard output and errors of a setup, begun in the tree."""
    env = {"PATH": str(tree / "bin"), "STEPWISE_INCLUDE": str(tree / "include")} | environment
    words = [tree / "bin" / "sh", script or tree / "scripts" / "setup.sh", "study"]
    done = subprocess.run(words, env=env, cwd=tree, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def whole(tree: Path) -> None:
    """Nothing is lacking."""
    for name in ("perf", "llvm-mca"):
        command(tree, name, ":")


def python(tree: Path, body: str) -> None:
    """The venv's, a stand-in."""
    path = tree / ".venv" / "bin" / "python"
    path.unlink()
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)


def setup(tree: Path, update: str = "", install: str = "exit 100") -> tuple[str, list[str], bool]:
    """What it says, what it asked apt-get for, and whether it will not ask for perf again."""
    log = tree / "asked"
    log.write_text("")
    case = f'case "$1" in update) {update or ":"} ;; install) {install} ;; esac'
    command(tree, "apt-get", f'echo "$*" >>{log}\n{case}')
    status, said, error = ends(tree)
    assert (status, error) == (0, "")
    kept = tree / "build" / "setup.without"
    return said, log.read_text().splitlines(), kept.exists() and "perf\n" in kept.read_text()


def test_what_apt_does_not_have_is_asked_for_once(tree: Path) -> None:
    command(tree, "apt-cache", "exit 100")
    said, asked, remembered = setup(tree)
    assert remembered and said.startswith("setup: ") and "perf" in said
    assert [line.split()[0] for line in asked] == ["update"]
    assert setup(tree) == ("", [], True)


@pytest.mark.parametrize("version", [pytest.param(3, marks=pytest.mark.slow), 4])
def test_a_library_is_known_by_its_header(tree: Path, version: int) -> None:
    whole(tree)
    header = tree / "include" / "embree3" / "rtcore.h"
    header.unlink()
    said, asked, _ = setup(tree)
    assert "rtcore.h" in said and "Embree" in said
    assert [line.split()[-1] for line in asked] == ["update", "libembree-dev"] or "-q" in asked[0]
    assert asked[-1].endswith("libembree-dev") and not (tree / "build" / "setup.without").exists()
    header = tree / "include" / f"embree{version}" / "rtcore.h"
    setup(tree, install=f"/bin/mkdir -p {header.parent}; /bin/touch {header}")
    assert header.exists() and setup(tree) == ("", [], False)


@pytest.mark.parametrize(
    "trouble",
    [
        {"update": UNREACHABLE},
        pytest.param({"update": "exit 100"}, marks=pytest.mark.slow),
        pytest.param({"install": CUT_OFF}, marks=pytest.mark.slow),
    ],
)
def test_what_the_network_kept_back_is_tried_again(tree: Path, trouble: dict[str, str]) -> None:
    said, asked, remembered = setup(tree, **trouble)
    assert not remembered and "perf" in said
    assert sum(line.startswith("update") for line in asked) == 1
    both = f"{tree}/bin/perf {tree}/bin/llvm-mca"
    said, asked, _ = setup(tree, install=f"/bin/touch {both}; /bin/chmod 755 {both}")
    assert (tree / "bin" / "perf").exists() and len(asked) == 2  # the lists, and one package brought both


def test_a_path_of_any_letters(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    whole(tree)
    moved = tmp_path_factory.mktemp("x") / 'it\'s "quoted", a käfig ×'
    shutil.copytree(tree, moved, symlinks=True)
    assert ends(moved, HOME="") == (0, "", "")  # and without a home
    (moved / "requirements.lock").write_text("# another\n")
    python(moved, "exit 0")
    assert ends(moved)[::2] == (0, "")


def test_without_sudo_what_to_type_is_one_line(tree: Path) -> None:
    whole(tree)
    for name in ("pkg-config", "sudo", "id"):
        (tree / "bin" / name).unlink()
    command(tree, "id", "echo 1000")
    command(tree, "apt-get", ":")
    status, _, error = ends(tree)
    assert status == 1 and error.count("\n") == 1 and {"sudo", "pkg-config"} <= set(error.split())


@pytest.mark.parametrize(
    ("version", "fits"), [("3.10", False), ("3.11", True), ("3.14", True), ("3.15", False)]
)
def test_versions_of_python(tree: Path, version: str, fits: bool) -> None:
    text = (ROOT / "scripts" / "setup.sh").read_text()
    code = text.partition("right_python='")[2].partition("'")[0]
    asked = f"import sys; sys.version_info = ({version.replace('.', ', ')}, 1); {code}"
    assert (subprocess.run([PYTHON, "-c", asked]).returncode == 0) == fits


LOCK = """one==1 \\
    --hash=sha256:11 \\
    --hash=sha256:12
    # via x
little==2 \\
    --hash=sha256:22
"""


# pip, which has no wheel of the first, in another language than English; the last word is the lock's name.
PIP = """case "$*" in --version) echo Python 3.14.0; exit ;; *"pip install"*) ;; *) exit 0 ;; esac
while [ $# -gt 1 ]; do shift; done
if grep -q "^one==" "$1"; then echo "FEHLER: kein passendes Paket"; exit 1; fi; cat "$1" >"""


def test_a_package_without_a_wheel_is_named_and_the_rest_goes_on(tree: Path) -> None:
    whole(tree)
    (tree / "requirements.lock").write_text(LOCK)
    python(tree, f"{PIP}{tree}/installed")
    status, said, error = ends(tree)
    assert (status, error) == (0, "")
    assert re.search(r"^setup: one .* Python 3\.14\.0", said, re.MULTILINE)
    assert re.findall(r"(?m)^\w+|:\d+", (tree / "installed").read_text()) == ["little", ":22"]
    assert ends(tree) == (0, "", "")
    assert (tree / ".venv" / ".without").read_text() == "one\n"


def test_a_path_of_folders_to_go_to_does_not_lead_it_elsewhere(tree: Path, tmp_path: Path) -> None:
    """CDPATH: `cd scripts/..` goes to another folder that has one, and would remove its .venv there."""
    whole(tree)
    other = tmp_path / "other"
    (other / "scripts").mkdir(parents=True)
    kept = other / ".venv" / "kept"
    kept.parent.mkdir()
    kept.touch()
    assert ends(tree, "scripts/setup.sh", CDPATH=str(other)) == (0, "", "")
    assert kept.exists() and not (other / "build").exists() and (tree / "build").exists()


NEW = """case "$*" in *venv*) ;; *) exec "$REAL" "$@" ;; esac
mkdir -p .venv/bin; printf '#!/bin/sh\\nexit 0\\n' >.venv/bin/python; chmod 755 .venv/bin/python"""


@pytest.mark.parametrize("change", ["another version", "another machine"])
def test_an_environment_of_another_python_is_made_anew(tree: Path, change: str) -> None:
    """After an upgrade, the Python that .venv links to looks for its packages in a folder of another version.
    Those of another machine are there, and cannot be loaded."""
    whole(tree)
    python3 = Path(shutil.which("chmod") or ""), tree / "bin" / "python3"
    (tree / "bin" / "chmod").symlink_to(python3[0])
    python3[1].unlink()
    command(tree, "python3", f"REAL={PYTHON}\n{NEW}")
    packages = tree / ".venv" / "lib" / f"python3.{sys.version_info.minor}" / "site-packages"
    if change == "another version":
        packages.parent.rename(packages.parent.with_name("python3.2"))
    else:
        (packages / "numpy.py").write_text("raise ImportError('wrong ELF class')")
    without = tree / "build" / "setup.without"
    without.parent.mkdir()
    without.write_text("perf\n")
    status, said, error = ends(tree)
    assert not without.exists()
    assert (status, error) == (0, "") and "made anew" in said and said.endswith("setup: done\n")
    assert not packages.parent.parent.exists() and ends(tree) == (0, "", "")


def test_packages_that_the_shell_exports_do_not_count(tree: Path) -> None:
    whole(tree)
    (tree / "exported").mkdir()
    (tree / "exported" / "numpy.py").write_text("raise SystemError('the wrong numpy')")
    assert ends(tree, PYTHONPATH=str(tree / "exported"), PYTHONHOME="/nowhere") == (0, "", "")


def machine(tree: Path, name: str) -> None:
    (tree / "bin" / "uname").unlink()  # the link, not what it points at
    command(tree, "uname", f"echo {name}")


def test_arm64_needs_simdes_headers_and_no_model_of_x86(tree: Path) -> None:
    command(tree, "perf", ":")
    machine(tree, "aarch64")
    headers = tree / "include" / "simde" / "x86"
    made = f"/bin/mkdir -p {headers}; /bin/touch {headers}/avx2.h"
    said, asked, _ = setup(tree, install=made)
    assert "libsimde-dev" in said and [line.split()[-1] for line in asked][1:] == ["libsimde-dev"]
    assert setup(tree) == ("", [], False)  # llvm-mca is not there either


def test_another_machine_gets_nothing(tree: Path) -> None:
    machine(tree, "riscv64")
    status, said, error = ends(tree)
    assert (status, said, error.count("\n")) == (1, "", 1) and "riscv64" in error
