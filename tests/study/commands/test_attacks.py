"""Phases that a judge must survive, in a copy of the project: each has a status and a line, leaves nothing.

Each derives from baseline. Their code stands at the head of phase_prepare or of phase_render.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import copied
import needs
import pytest

from study.commands import new_phase
from study.commands.labs import judge
from study.core.registry import ROOT
from study.labs import memory

pytestmark = pytest.mark.slow

HEAD = "#include <stdio.h>\n#include <sys/socket.h>\n#include <arpa/inet.h>\n#include <unistd.h>\n"
GIVE_UP = '{ perror("%s"); exit(9); }'
HOME = 'char at[4096]; snprintf(at, sizeof at, "%s/left", getenv("HOME")); FILE *f = fopen(at, "w");'
SOCKET = (
    "struct sockaddr_in a = {.sin_family = AF_INET, .sin_port = 20480}; a.sin_addr.s_addr = 0x010200c0;"
    "int s = socket(AF_INET, SOCK_STREAM, 0);"
)
PREPARE, RENDER = (
    "    (void)threads; // one\n",
    "    struct world world = world_of(&prepared->model, view);\n",
)
PREPARED = {  # by name: what phase_prepare begins with, and what is seen of it
    "home": (f"{HOME} if (!f) {GIVE_UP % 'home'} fclose(f);", "ends", "home: Read-only"),
    "socket": (
        f"{SOCKET} if (connect(s, (struct sockaddr *)&a, sizeof a)) {GIVE_UP % 'socket'}",
        "ends",
        "socket: Network",
    ),
    "sleeps": ("sleep(1000000);", "late", "render.c:"),
    "turns": ("for (volatile int i = 0; i >= 0; i = 0) {}", "late", "render.c:"),
    "large": ("char *p = malloc(64ul << 30); p[threads] = 1; fputs(p, stderr);", "room", "render.c:"),
}
RENDERED = {
    "behind": ("frame->rgb[3 * frame->width * frame->height] = 0;", "plane", "render.c:"),
    "wild": ("frame->rgb[300000 + 3 * frame->width * frame->height] = 0;", "plane", "render.c:"),
    "before": ("frame->rgb[-300000] = 0;", "plane", "render.c:"),
    "null": ("*(volatile float *)&frame->shown[view->position[0] > 1e9] = 0;", "undefined", "render.c:"),
}
SHORT = ("(sizeof(struct shape) + sizeof(struct turn))", "(sizeof(struct shape) + sizeof(struct turn)) - 8")
WRAPPER = '#!/bin/sh\ntouch "$HOME/left" || exit 7\nexec "$@"\n'


def phase(root: Path, name: str, sources: dict[str, str], cflags: str = "") -> None:
    folder = root / "phases" / name
    folder.mkdir()
    for file, text in sources.items():
        (folder / file).write_text(text)
    about = json.loads((ROOT / "phases/baseline/phase.json").read_text())
    own = {key: about[key] for key in ("title", "idea", "paper")}
    own |= {"name": name, "order": 90, "parent": "baseline", "derives": "baseline"}
    own |= {"cflags": f"{about['cflags']} {cflags}"} if cflags else {}
    (folder / "phase.json").write_text(json.dumps(own))


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = copied.built(copied.sources(tmp_path_factory.mktemp("attacks")))
    plain = (ROOT / "phases/baseline/render.c").read_text()
    for before, attacks in ((PREPARE, PREPARED), (RENDER, RENDERED)):
        for name, (code, *_) in attacks.items():
            assert before in plain
            phase(root, name, {"render.c": HEAD + plain.replace(before, f"{before}    {code}\n")})
    sources = new_phase.sources("baseline+1_precomputed", ROOT, whole=False)
    phase(root, "right", sources)
    assert SHORT[0] in sources["render.c"]
    phase(root, "short", sources | {"render.c": sources["render.c"].replace(*SHORT)})
    # The sandbox asks no ccache, and the phase that sleeps has little time to be built.
    programs = (
        ("BUILD=build/judge", *memory.SETTINGS, "build/judge/baseline/render"),
        ("build/baseline/render",),
    )
    for words in programs:
        subprocess.run(["make", "-s", *words], cwd=root, check=True)
    phase(root, "wrapped", {"render.c": plain, "wrap.sh": WRAPPER}, "-wrapper sh,phases/wrapped/wrap.sh")
    return root


def judged(root: Path, name: str, home: Path, *words: object) -> subprocess.CompletedProcess[str]:
    command = ["scripts/stepwise", "judge", 1, "--phase", name, "--untimed", "-n", 18, *words]
    more = {"HOME": str(home), "STEPWISE_CHILD_SECONDS": "30" if name in ("sleeps", "turns") else "300"}
    environment = {key: value for key, value in os.environ.items() if key != "STEPWISE_BUILT"} | more
    return subprocess.run(list(map(str, command)), cwd=root, capture_output=True, text=True, env=environment)


@pytest.mark.parametrize("name", [*PREPARED, *RENDERED, "short"])
def test_a_line_and_a_status(root: Path, name: str, tmp_path: Path) -> None:
    """Those that want to go out need the sandbox; limits and sanitizers do without."""
    if name in ("home", "socket"):
        needs.sandbox(tmp_path)
    done = judged(root, name, tmp_path, "--json")
    assert done.returncode == 1, done.stderr
    checks = json.loads(done.stdout)["result"]["checks"]
    assert [one["passed"] for one in checks] == [True, False] and checks[1]["name"] == "memory"
    known = PREPARED | RENDERED | {"short": ("", "array", f"phases/{name}/render.c:")}
    assert (checks[1]["hint"], known[name][2] in checks[1]["said"]) == (known[name][1], True), checks[1]
    assert json.loads(done.stdout)["result"]["hint"] == judge.HINTS[known[name][1]]
    assert f"build/judge/{name}/render" in checks[1]["text"] and not (tmp_path / "left").exists()


def test_a_compiler_that_is_told_to_write(root: Path, tmp_path: Path) -> None:
    """Status 4; without the sandbox the same phase does write."""
    needs.sandbox(tmp_path)
    home = tmp_path / "home"
    home.mkdir()
    done = judged(root, "wrapped", home, "--sandbox")
    assert done.returncode == judge.DOES_NOT_COMPILE and "Read-only file system" in done.stdout
    assert not (home / "left").exists()
    judged(root, "wrapped", home)
    assert (home / "left").exists()


def test_a_right_phase_is_right_in_the_sandbox(root: Path, tmp_path: Path) -> None:
    """And results.json has a point for each check, where nothing else may be written."""
    out = tmp_path / "results.json"
    done = judged(root, "right", tmp_path, "--gradescope", out)
    assert done.returncode == 0, done.stdout + done.stderr
    tests = json.loads(out.read_text())["tests"]
    assert {one["name"]: one["score"] for one in tests} == dict.fromkeys(
        ("unchanged", "memory", "views", "picture", "work"), 1
    )
