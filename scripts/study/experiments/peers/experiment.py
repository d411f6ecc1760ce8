"""Our phases beside what one would use instead: POV-Ray, Dr.Jit, OpenGL on the CPU and others."""

from study.experiments.experiment import Experiment
from study.experiments.peers import command, tables
from study.numbers.beside import PEERS, Peers

EXPERIMENT = Experiment(
    name="peers",
    what="our phases beside other programs",
    turn=145,
    schemas={PEERS: Peers},
    depth=None,  # it draws with what the user has installed for it, so no two studies would have the same
    sections=[(165, tables.section)],
    cut="The other programs are not among what `make study` installs.",
    command=command,
)
