"""Has the workers of a Dask cluster draw shards of an experiment; run by the Python in build/farm.

One JSON object on standard input says what to do (study.experiments.farm.measure.plan), one on standard
output what came of it. Nothing of the project is imported here: the workers start its command. Dask gives the
shard of a worker that dies to another.
"""

import ctypes
import json
import logging
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

PR_SET_PDEATHSIG = 1  # of prctl(2): the signal that a process gets when its parent dies
MOST = 3  # times that a shard whose worker has died, or could not draw it, is given to another


class Failed(Exception):
    """One line: why the farm cannot go on."""


def run_shard(command: list[str], number: int, of: int, file: str) -> SimpleNamespace:
    """Runs on a worker: its name and address, and what `drawn` gives or, as `error`, why there is nothing."""
    from distributed import get_worker

    worker = get_worker()
    run = Path(worker.local_directory, f"run-{worker.name}".replace("/", "-"))
    try:
        made = drawn([*command, "--shard", f"{number}/{of}", "--run", str(run)], run, file)
    except OSError as error:
        made = {"error": str(error)}
    return SimpleNamespace(worker=str(worker.name), address=worker.address, **{"error": "", **made})


def drawn(words: list[str], run: Path, file: str) -> dict[str, Any]:
    """One shard by the project's command, in the folder `run` of this worker. Raises OSError. Pictures of the
    worker's earlier shards lie there, so that none is rendered twice. The command ends with its worker, even
    if that is killed."""
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
    pictures = [picture for row in json.loads(data).get("rows", []) if (picture := row.get("picture"))]
    files = {f"shards/{file}": data, **{name: (run / name).read_bytes() for name in pictures}}
    return {"failed": [line for line in lines if line.startswith("FAIL ")], "files": files}


def draw(client: Any, plan: SimpleNamespace) -> tuple[dict[int, list[str]], Counter[str]]:
    """Has every shard drawn and its files written. Checks that failed, by shard; shards by worker. A worker
    that cannot run the command gets no more. Raises Failed."""
    from distributed import KilledWorker, as_completed

    def submit(shard: int) -> Any:
        words = plan.command, shard, plan.shards, plan.file.replace("{K}", str(shard))
        return client.submit(run_shard, *words, pure=False)

    shards = {submit(shard): shard for shard in range(1, plan.shards + 1)}
    failed: dict[int, list[str]] = {}
    counts: Counter[str] = Counter()
    tries: Counter[int] = Counter()
    done = as_completed(list(shards))
    for future in done:
        shard = shards.pop(future)
        place = f"shard {shard}/{plan.shards}"
        try:
            result = future.result()
        except KilledWorker:
            raise Failed(f"{place}: {MOST + 1} workers that took it have died") from None
        future.release()
        if not result.error:
            for name, data in result.files.items():
                write(Path(plan.folder, name), data)
            failed[shard] = result.failed
            counts[result.worker] += 1
            continue
        said = f"{place}: worker {result.worker}: {result.error}"
        tries[shard] += 1
        others = set(client.scheduler_info(n_workers=-1)["workers"]) - {result.address}
        if tries[shard] > MOST or not others:
            raise Failed(said)
        client.retire_workers([result.address])
        sys.stderr.write(f"farm: {said}; it gets no more\n")
        again = submit(shard)
        shards[again] = shard
        done.add(again)
    return failed, counts


def write(path: Path, data: bytes) -> None:
    """The file whole, or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        made.write_bytes(data)
        made.replace(path)
    finally:
        made.unlink(missing_ok=True)


def work(plan: SimpleNamespace) -> dict[str, Any]:
    """Everything: who has drawn how many shards, in which time, and which checks failed. Raises Failed."""
    import dask
    from distributed import CancelledError, Client

    # A worker has one shard at a time: one that dies loses no other.
    how = {"allowed-failures": MOST, "worker-saturation": 1.0}
    dask.config.set({f"distributed.scheduler.{name}": value for name, value in how.items()})
    local = {"n_workers": plan.workers, "threads_per_worker": 1, "processes": True}
    local |= {"dashboard_address": None, "memory_limit": 0, "local_directory": plan.scratch}
    begun = time.monotonic()
    try:
        client = Client(plan.scheduler) if plan.scheduler else Client(**local)
    except (OSError, ValueError) as error:
        raise Failed(f"{plan.scheduler}: no scheduler answers ({error})") from None
    try:
        client.wait_for_workers(plan.workers or 1, timeout=plan.wait_s)
    except TimeoutError:
        raise Failed(f"no worker has come within {plan.wait_s:g} s") from None
    for name, threads in client.nthreads().items():
        if threads != 1:
            raise Failed(f"worker {name} has {threads} threads; give it --nthreads 1")
    try:
        failed, counts = draw(client, plan)
    except CancelledError:
        raise Failed("the scheduler has gone") from None
    client.close()  # and the workers that it has started
    return {
        "workers": [{"name": name, "shards": count} for name, count in sorted(counts.items())],
        "seconds": time.monotonic() - begun,
        "failed": [line for shard in sorted(failed) for line in failed[shard]],
    }


def main() -> int:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)  # the driver ends with who started it
    os.environ["DASK_LOGGING__DISTRIBUTED"] = "critical"  # of the workers
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        result = work(json.load(sys.stdin, object_hook=lambda keys: SimpleNamespace(**keys)))
    except Failed as error:
        result = {"error": " ".join(str(error).split())}
    print(json.dumps(result), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
