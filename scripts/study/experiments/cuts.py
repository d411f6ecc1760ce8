"""What a quick study measured of each experiment, kept with the run (study.json): the page says it."""

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


def read(run: Path) -> dict[str, str]:
    """Experiment → what the run has of it, a sentence; those that are whole are not in it."""
    found = Cuts.load_if_there(run / STUDY)
    return found.cut if found else {}


def note(run: Path, experiment: str, text: str) -> None:
    """Keeps what was measured of an experiment: a sentence, or nothing where it is whole."""
    few = read(run) | {experiment: text}
    store.write_json(run / STUDY, Cuts(cut={name: said for name, said in few.items() if said}))
