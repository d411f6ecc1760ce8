"""Has the workers of a Dask cluster draw shards of an experiment; run by the Python in build/farm.

One JSON object on standard input says what to do (study.experiments.farm.measure.plan), one on standard
output what came of it. Nothing of the project is imported here: the workers start its command. Dask gives the
shard of a worker that dies to another.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

PR_SET_PDEATHSIG = 1  # of prctl(2): the signal that a process gets when its parent dies
MOST = 3  # times that a shard whose worker has died, or could not draw it, is given to another
ONE_IN = 100  # shards: one of so many is drawn on another worker as well, and one of each worker at least
Result = dict[str, Any]


class Failed(Exception):
    """One line: why the farm cannot go on."""


def run_shard(command: list[str], number: int, of: int, file: str) -> Result:
    """On a worker: its name and address, and what `drawn` gives or, as `error`, why there is nothing."""
    from distributed import get_worker

    worker = get_worker()
    run = Path(worker.local_directory, f"run-{worker.name}".replace("/", "-"))
    try:
        made = drawn([*command, "--shard", f"{number}/{of}", "--run", str(run)], run, file)
    except OSError as error:
        made = {"error": str(error)}
    return {"worker": str(worker.name), "address": worker.address, **made}


def drawn(words: list[str], run: Path, file: str) -> Result:
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


class Farm:
    """The shards `of` a command on the workers of a client."""

    def __init__(self, client: Any, plan: Result) -> None:
        self.client, self.plan = client, plan
        self.of, self.folder = plan["shards"], Path(plan["folder"])
        self.counts: Counter[str] = Counter()  # worker → shards that it has drawn

    def living(self) -> dict[str, str]:
        """Name → address of the workers. Raises Failed for one with more than one thread."""
        found = self.client.scheduler_info(n_workers=-1)["workers"]
        for one in found.values():
            if one["nthreads"] != 1:
                raise Failed(f"worker {one['name']} has {one['nthreads']} threads; give it --nthreads 1")
        return {str(one["name"]): address for address, one in found.items()}

    def _submit(self, shard: int, addresses: list[str]) -> Any:
        words = self.plan["command"], shard, self.of, self.plan["file"].replace("{K}", str(shard))
        where = {"workers": addresses, "allow_other_workers": True} if addresses else {}
        return self.client.submit(run_shard, *words, pure=False, **where)

    def draw(self, wanted: Mapping[int, list[str]], keep: bool = True) -> dict[int, Result]:
        """Each shard's result, drawn at best by workers of those addresses. Not `keep`: only to be compared.
        Raises Failed."""
        from distributed import KilledWorker, as_completed

        shards = {self._submit(shard, addresses): shard for shard, addresses in wanted.items()}
        failures: Counter[int] = Counter()
        results: dict[int, Result] = {}
        done = as_completed(list(shards))
        for future in done:
            shard = shards.pop(future)
            try:
                result = future.result()
            except KilledWorker:
                many = f"{MOST + 1} workers that took it have died"
                raise Failed(f"shard {shard}/{self.of}: {many}") from None
            future.release()
            if "error" not in result:
                results[shard] = self._taken(result, keep)
                continue
            said = f"shard {shard}/{self.of}: worker {result['worker']}: {result['error']}"
            failures[shard] += 1
            if failures[shard] > MOST or not self.retire(result["worker"], result["address"]):
                raise Failed(said)
            say(f"{said}; it gets no more")
            again = self._submit(shard, [])
            shards[again] = shard
            done.add(again)
        return results

    def retire(self, worker: str, address: str) -> bool:
        """Gives a worker nothing more. Whether there is another."""
        living = self.living()
        if set(living) <= {worker}:
            return False
        if worker in living:
            self.client.retire_workers([address])
        return True

    def _taken(self, result: Result, keep: bool) -> Result:
        """A result without its data, which are written as a file named by their hash."""
        result["hash"] = hashlib.sha256(result["data"]).hexdigest()
        write(self.folder / "shards" / f"{result['hash']}.json", result.pop("data"))
        for name, data in result.pop("pictures").items():
            if keep:
                write(self.folder / name, data)
        self.counts[result["worker"]] += 1
        return result


def write(path: Path, data: bytes) -> None:
    """The file whole, or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made = path.with_name(f".{path.name}.{os.getpid()}")
    made.write_bytes(data)
    made.replace(path)


def checks(first: Mapping[int, Result], living: list[str]) -> dict[int, str]:
    """What is to be drawn on a second worker: shard → that worker. A shard of each worker, by the next one
    of those that live, and of all shards one in ONE_IN."""
    drawn: dict[str, list[int]] = {}
    for shard in sorted(first):
        drawn.setdefault(first[shard]["worker"], []).append(shard)
    chosen = {shards[0] for shards in drawn.values()} | set(sorted(first)[::ONE_IN])
    found = {}
    for turn, shard in enumerate(sorted(chosen)):
        others = [name for name in sorted(living) if name != first[shard]["worker"]]
        if others:
            found[shard] = others[turn % len(others)]
    return found


def odd_one(results: list[Result]) -> str | None:
    """Whose result differs from those of two others that agree; None: no two agree, or there are but two."""
    for one in results:
        others = {other["hash"] for other in results if other is not one}
        if len(results) == 3 and len(others) == 1 and one["hash"] not in others:
            return one["worker"]
    return None


def judge(farm: Farm, first: dict[int, Result]) -> Result:
    """Has some shards drawn twice, and a third time where two workers differ. Changes `first`: what an odd
    worker drew is replaced, and what nobody knows loses its hash. Raises Failed."""
    living = farm.living()
    wanted = {shard: [living[name]] for shard, name in checks(first, list(living)).items()}
    second = farm.draw(wanted, keep=False)
    unlike = [shard for shard, one in second.items() if one["hash"] != first[shard]["hash"]]
    others = {
        shard: [
            at for name, at in living.items() if name not in (first[shard]["worker"], second[shard]["worker"])
        ]
        for shard in unlike
    }
    third = farm.draw({shard: where for shard, where in others.items() if where}, keep=False)
    mismatches, odd = [], {}
    for shard in unlike:
        results = [by[shard] for by in (first, second, third) if shard in by]
        wrong = odd_one(results)
        mismatches.append({"shard": shard, "workers": [one["worker"] for one in results], "odd": wrong})
        if wrong:
            odd[wrong] = next(one["address"] for one in results if one["worker"] == wrong)
        else:
            first[shard]["hash"] = None  # nobody knows it
    for worker, address in odd.items():
        farm.retire(worker, address)
    again = [shard for shard, one in first.items() if one["worker"] in odd and one["hash"]]
    first |= farm.draw({shard: [] for shard in again})
    return {"drawn_twice": len(second), "mismatches": mismatches, "recomputed": len(again)}


def say(text: str) -> None:
    sys.stderr.write(f"farm: {text}\n")
    sys.stderr.flush()


def cluster_of(plan: Result) -> Any:
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


def work(plan: Result) -> Result:
    """Everything: the farm's table, and each shard's hash. Raises Failed."""
    import dask
    from distributed import CancelledError, Client

    # A worker has one shard at a time: one that dies loses no other.
    how = {"allowed-failures": MOST, "worker-saturation": 1.0}
    dask.config.set({f"distributed.scheduler.{name}": value for name, value in how.items()})
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
    farm.living()
    try:
        first = farm.draw({shard: [] for shard in range(1, farm.of + 1)})
        about = judge(farm, first)
    except CancelledError:
        raise Failed("the scheduler has gone") from None
    client.close()
    if hasattr(cluster, "close"):
        cluster.close()
    order = [first[number] for number in sorted(first)]
    table = {
        "workers": [{"name": name, "shards": count} for name, count in sorted(farm.counts.items())],
        "shards": farm.of,
        "done": sum(1 for one in order if one["hash"]),
        **about,
        "seconds": time.monotonic() - begun,
    }
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
