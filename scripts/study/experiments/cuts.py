"""What a quick study measured of each experiment, kept with the run (study.json): the page says it."""

from collections.abc import Sequence
from pathlib import Path

from study.core import store
from study.core.registry import Spec, cpu_supports, ladder
from study.core.run_schema import STUDY, Cuts


def three() -> list[str]:
    """The first phase of the ladder, the paper's last and the last, as far as this CPU has them."""
    known = ladder()
    whole = [name for name, phase in known.items() if not phase.variants and not phase.derives]
    names = dict.fromkeys([*whole[:1], *whole[-1:], [*known][-1]])
    return [name for name in names if cpu_supports(Spec.parse(name))]


def counted() -> list[str]:
    """The paper's steps, whose work their authors declare function by function."""
    return [name for name, phase in ladder().items() if not phase.variants]


def remarks(run: Path) -> list[str]:
    """What the commands of its study remarked."""
    found = Cuts.load_if_there(run / STUDY)
    return found.remarks if found else []


def read(run: Path) -> dict[str, str]:
    """Experiment → what the run has of it, a sentence; those that are whole are not in it."""
    found = Cuts.load_if_there(run / STUDY)
    return found.cut if found else {}


def note(run: Path, experiment: str, text: str, remarks: Sequence[str] = ()) -> None:
    """Keeps what was measured of an experiment: a sentence, or nothing where it is whole; remarks once."""
    old = Cuts.load_if_there(run / STUDY) or Cuts(cut={})
    few, mine = old.cut | {experiment: text}, f"{experiment}: "
    said = [one for one in old.remarks if not one.startswith(mine)] + [
        mine + one for one in dict.fromkeys(remarks)
    ]
    store.write_json(run / STUDY, Cuts(cut={name: one for name, one in few.items() if one}, remarks=said))
