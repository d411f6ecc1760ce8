"""Has the workers of a Dask cluster draw shards of an experiment; run by the Python in build/farm.

One JSON object on standard input says what to do (study.experiments.farm.measure.plan), one on standard
output what came of it. Nothing of the project is imported here: the workers start its command.
"""

from __future__ import annotations

import ctypes
import hashlib
import itertools
import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

PR_SET_PDEATHSIG = 1  # of prctl(2): the signal that a process gets when its parent dies
POLL = 2.0  # s between two looks at whether the workers asked for still live
MOST = 3  # times that a shard whose worker has died, or could not draw it, is given to another
ONE_IN = 100  # shards: one of so many is drawn on another worker as well, and one of each worker at least


class Failed(Exception):
    """One line: why the farm cannot go on."""


def run_shard(command: list[str], number: int, of: int, file: str) -> dict[str, Any]:
    """On a worker: its name, and what `drawn` gives or, as `error`, why there is nothing."""
    from distributed import get_worker

    worker = get_worker()
    run = Path(worker.local_directory, f"run-{worker.name}".replace("/", "-"))
    try:
        made = drawn([*command, "--shard", f"{number}/{of}", "--run", str(run)], run, file)
    except OSError as error:
        made = {"error": str(error)}
    return {"worker": str(worker.name), **made}


def drawn(words: list[str], run: Path, file: str) -> dict[str, Any]:
    """One shard by the project's command, in the folder `run` of this worker. Raises OSError.

    Pictures of the worker's earlier shards lie there, so that none is rendered twice. The command ends with
    its worker, even if that is killed.
    """
    made = run / file
    made.unlink(missing_ok=True)
    libc = ctypes.CDLL(None)
    done = subprocess.run(
        words,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        preexec_fn=lambda: libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM),
    )
    lines = done.stderr.strip().splitlines()
    if not made.exists():
        return {"error": f"status {done.returncode}: {lines[-1] if lines else 'no word'}"}
    data = made.read_bytes()
    pictures = [row["picture"] for row in json.loads(data).get("rows", []) if row.get("picture")]
    return {
        "data": data,
        "failed": [line for line in lines if line.startswith("FAIL ")],
        "pictures": {name: (run / name).read_bytes() for name in pictures},
    }


@dataclass
class Job:
    """A shard that is to be drawn, by a worker that is not among `avoid`, if it can be by `by`. `check`: only
    to be compared, so that its pictures are not kept."""

    shard: int
    avoid: set[str] = field(default_factory=set)
    by: str | None = None
    check: bool = False
    failures: int = 0  # workers that could not draw it


class Farm:
    """The shards `of` a command on the workers of a client."""

    def __init__(self, client: Any, plan: dict[str, Any]) -> None:
        self.client, self.plan = client, plan
        self.of, self.folder = plan["shards"], Path(plan["folder"])
        self.killed = self.recomputed = 0
        self.keys = (f"farm-{os.getpid()}-{number}" for number in itertools.count())
        self.running: dict[str, int] = {}  # key → shard
        self.known: dict[str, str] = {}
        self.asked = -POLL  # when they were last asked for
        self.broken: dict[str, str] = {}  # worker → how its command failed; it gets nothing more
        self.counts: dict[str, int] = {}  # worker → shards that it has drawn
        client.subscribe_topic("all", self._event)

    def _event(self, event: tuple[float, Any]) -> None:
        """Of the scheduler: a worker has gone. Dask gives its tasks to another."""
        message = event[1]
        if not isinstance(message, dict) or message.get("action") != "remove-worker":
            return
        shards = [self.running[key] for key in message["processing-tasks"] if key in self.running]
        self.asked = -POLL
        if shards:
            self.killed += 1
            self.recomputed += len(shards)
            say(f"a worker has died; drawn again on another: shard {', '.join(map(str, shards))}")

    def living(self) -> dict[str, str]:
        """Name → address of the workers that are not broken, as of POLL ago at most: the list may be long.

        Raises Failed for one with more than one thread.
        """
        if time.monotonic() - self.asked < POLL:
            return self.known
        found = self.client.scheduler_info(n_workers=-1)["workers"]
        for one in found.values():
            if one["nthreads"] != 1:
                raise Failed(f"worker {one['name']} has {one['nthreads']} threads; give it --nthreads 1")
        self.known = {
            str(one["name"]): address for address, one in found.items() if str(one["name"]) not in self.broken
        }
        if found and not self.known:
            raise Failed(next(reversed(self.broken.values())))
        self.asked = time.monotonic()
        return self.known

    def _submit(self, job: Job, living: dict[str, str]) -> tuple[Any, list[str]]:
        """The future, and the addresses it may run on: none means all."""
        allowed = [address for name, address in living.items() if name not in job.avoid]
        if job.by in living:
            allowed = [living[job.by]]
        key = next(self.keys)
        self.running[key] = job.shard
        words = self.plan["command"], job.shard, self.of, self.plan["file"].replace("{K}", str(job.shard))
        chosen = allowed if job.avoid or job.by or self.broken else []
        where = {"workers": chosen} if chosen else {}
        return self.client.submit(run_shard, *words, key=key, pure=False, **where), chosen

    def draw(self, jobs: list[Job]) -> dict[int, dict[str, Any] | None]:
        """Each job's result by its shard, None: nobody may draw it. No more run than there are workers, so
        that one that dies loses one. Raises Failed."""
        from distributed import wait

        waiting, results = list(reversed(jobs)), {}
        flying: dict[Any, tuple[Job, list[str]]] = {}
        while waiting or flying:
            living = self.living()
            while waiting and len(flying) < max(1, len(living)):
                job = waiting.pop()
                if living and not set(living) - job.avoid:
                    results[job.shard] = None  # there is nobody else to draw it
                    continue
                future, chosen = self._submit(job, living)
                flying[future] = job, chosen
            if not flying:
                continue
            try:
                done = wait(list(flying), timeout=POLL, return_when="FIRST_COMPLETED").done
            except TimeoutError:
                done = set()
            for future in done:
                job, _ = flying.pop(future)
                result = self._taken(future, job)
                if "error" in result:
                    waiting.append(self._elsewhere(job, result))
                else:
                    results[job.shard] = result
            addresses = set(living.values())
            for future, (job, chosen) in list(flying.items()):
                if chosen and not addresses & set(chosen):  # all that it may run on have gone
                    future.cancel()
                    self.running.pop(future.key, None)
                    del flying[future]
                    waiting.append(replace(job, by=None))
        return results

    def _elsewhere(self, job: Job, result: dict[str, Any]) -> Job:
        """The job again, for a worker that can run the command. Raises Failed if many could not."""
        worker = result["worker"]
        self.broken[worker] = f"shard {job.shard}/{self.of}: worker {worker}: {result['error']}"
        self.asked = -POLL
        if job.failures == MOST:
            raise Failed(self.broken[worker])
        say(f"{self.broken[worker]}; it gets no more")
        return replace(job, by=None, failures=job.failures + 1)

    def _taken(self, future: Any, job: Job) -> dict[str, Any]:
        """A result without its data, which are written as a file named by their hash. Raises Failed."""
        from distributed import KilledWorker

        self.running.pop(future.key, None)
        try:
            result = future.result()
        except KilledWorker:
            raise Failed(f"shard {job.shard}/{self.of}: {MOST + 1} workers that took it have died") from None
        future.release()
        if "error" in result:
            return result
        result["hash"] = hashlib.sha256(result["data"]).hexdigest()
        write(self.folder / "shards" / f"{result['hash']}.json", result.pop("data"))
        for name, data in result.pop("pictures").items():
            if not job.check:
                write(self.folder / name, data)
        self.counts[result["worker"]] = self.counts.get(result["worker"], 0) + 1
        return result


def write(path: Path, data: bytes) -> None:
    """The file whole, or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made = path.with_name(f".{path.name}.{os.getpid()}")
    made.write_bytes(data)
    made.replace(path)


def checks(first: dict[int, dict[str, Any]], living: list[str]) -> list[Job]:
    """What is to be drawn on a second worker: a shard of each worker, and of all shards one in ONE_IN.

    Workers are paired: where the second draws the first's shard, both are held against each other.
    """
    drawn: dict[str, list[int]] = {}
    for shard, result in first.items():
        drawn.setdefault(result["worker"], []).append(shard)
    jobs: dict[int, Job] = {}
    held: set[str | None] = set()
    for name, shards in drawn.items():
        others = [other for other in (*drawn, *living) if other != name and other in living]
        partner = next((other for other in others if other not in held), others[0] if others else None)
        if name not in held:
            jobs[shards[0]] = Job(shards[0], {name}, partner, check=True)
            held |= {name, partner}
    more = -(-len(first) // ONE_IN) - len(jobs)
    left = [shard for shard in sorted(first) if shard not in jobs]
    for shard in left[:: max(1, len(left) // more)][:more] if more > 0 else ():
        name = first[shard]["worker"]
        others = [other for other in living if other != name]
        jobs[shard] = Job(shard, {name}, others[shard % len(others)] if others else None, check=True)
    return list(jobs.values())


def odd_one(results: list[dict[str, Any]]) -> str | None:
    """Whose result differs from those of two others that agree; None: no two agree, or there are but two."""
    for one in results:
        others = {other["hash"] for other in results if other is not one}
        if len(results) == 3 and len(others) == 1 and one["hash"] not in others:
            return one["worker"]
    return None


def judge(farm: Farm, first: dict[int, dict[str, Any]]) -> dict[str, Any]:
    """Has some shards drawn twice, and a third time where two workers differ. Changes `first`: what an odd
    worker drew is replaced, and what nobody knows loses its hash. Raises Failed."""
    jobs = checks(first, list(farm.living()))
    second = {shard: one for shard, one in farm.draw(jobs).items() if one}
    mismatches, odd = [], set()
    unlike = [shard for shard, one in second.items() if one["hash"] != first[shard]["hash"]]
    third = farm.draw([Job(n, {first[n]["worker"], second[n]["worker"]}, check=True) for n in unlike])
    for shard in unlike:
        drawn = [one for one in (first[shard], second[shard], third[shard]) if one]
        wrong = odd_one(drawn)
        workers = [one["worker"] for one in drawn]
        mismatches.append({"shard": shard, "workers": workers, "odd": wrong})
        if wrong:
            odd.add(wrong)
        else:
            first[shard]["hash"] = None  # nobody knows it
    again = [shard for shard, one in first.items() if one["worker"] in odd and one["hash"]]
    farm.recomputed += len(again)
    anew = farm.draw([Job(shard, set(odd)) for shard in again])
    first |= {shard: one or first[shard] | {"hash": None} for shard, one in anew.items()}
    return {"drawn_twice": len(second), "mismatches": mismatches}


def say(text: str) -> None:
    sys.stderr.write(f"farm: {text}\n")
    sys.stderr.flush()


def cluster_of(plan: dict[str, Any]) -> Any:
    """What a client connects to: an address, processes of this machine, or jobs of Slurm."""
    if plan["scheduler"]:
        return plan["scheduler"]
    if plan["slurm"]:
        if not shutil.which("sbatch"):
            raise Failed("sbatch is missing: --slurm is for a machine from which jobs go to Slurm")
        from dask_jobqueue import SLURMCluster

        made = SLURMCluster(cores=1, processes=1, memory="2 GB")
        made.scale(jobs=plan["slurm"])
        return made
    from distributed import LocalCluster

    workers = {"n_workers": plan["workers"], "threads_per_worker": 1, "processes": True}
    return LocalCluster(**workers, dashboard_address=None, memory_limit=0, local_directory=plan["scratch"])


def work(plan: dict[str, Any]) -> dict[str, Any]:
    """Everything: the farm's table, and each shard's hash. Raises Failed."""
    import dask
    from distributed import CancelledError, Client

    dask.config.set({"distributed.scheduler.allowed-failures": MOST})
    begun = time.monotonic()
    cluster = cluster_of(plan)
    try:
        client = Client(cluster)
    except (OSError, ValueError) as error:
        raise Failed(f"{plan['scheduler']}: no scheduler answers ({error})") from None
    try:
        client.wait_for_workers(plan["workers"] or 1, timeout=plan["wait_s"])
    except TimeoutError:
        raise Failed(f"no worker has come within {plan['wait_s']:g} s") from None
    farm = Farm(client, plan)
    try:
        first = farm.draw([Job(number) for number in range(1, farm.of + 1)])
        about = judge(farm, first)
    except CancelledError:
        raise Failed("the scheduler has gone") from None
    table = {
        "workers": [{"name": name, "shards": count} for name, count in sorted(farm.counts.items())],
        "shards": farm.of,
        "done": sum(1 for one in first.values() if one["hash"]),
        "killed": farm.killed,
        "recomputed": farm.recomputed,
        **about,
        "seconds": time.monotonic() - begun,
    }
    client.unsubscribe_topic("all")
    client.close()
    if hasattr(cluster, "close"):
        cluster.close()
    order = [first[number] for number in sorted(first)]
    failed = [line for one in order for line in one["failed"]]
    return {"table": table, "hashes": [one["hash"] for one in order], "failed": failed}


def main() -> int:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)  # the driver ends with who started it
    os.environ["DASK_LOGGING__DISTRIBUTED"] = "critical"  # of the workers
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        result = work(json.load(sys.stdin))
    except Failed as error:
        result = {"error": " ".join(str(error).split())}
    print(json.dumps(result), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
