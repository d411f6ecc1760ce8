"""Tab completion: what bash offers where, by the script that the command prints."""

import shutil
import subprocess

import pytest

from study.core import commands

PRESS = """\
source "$1"
shift
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
[[ $(complete -p stepwise) =~ -F\\ ([^ ]+) ]]
${BASH_REMATCH[1]} stepwise "${@: -1}" "${@: -2:1}"
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    """Shell -> its script."""
    folder, made = tmp_path_factory.mktemp("completion"), {}
    for shell in ("bash", "zsh"):
        (script,) = commands.called("completion", [shell])[0].lines
        made[shell] = folder / shell
        made[shell].write_text(script)
    return made


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("swe", "sweep"),
        ("sweep --ph", "--phase"),
        ("sweep --phase opt9", "opt9_convex"),
        ("sweep --phase opt4 opt5", "opt5_threads"),
        ("verify --scene mandelbulb_", "mandelbulb_closeup"),
        ("study --depth q", "quick"),
        ("lis", "list"),
    ],
)
def test_bash_offers(scripts, typed, offered):
    words = ["scripts/stepwise", *typed.split(" ")]
    done = subprocess.run(
        ["bash", "-c", PRESS, "bash", scripts["bash"], *words], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == [offered]


def test_every_command_is_in_the_script_of_either_shell(scripts):
    for shell, path in scripts.items():
        text = path.read_text()
        assert not [name for name in commands.find_all() if name not in text]
        if shutil.which(shell):
            subprocess.run([shell, "-n", path], check=True)
