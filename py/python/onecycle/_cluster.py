"""Campaigns on Dask: a task is a range of cases, and a case depends on the recipe and its number only."""

import json
import os
import tempfile
from pathlib import Path

from . import _onecycle

#: Tasks sent ahead for each thread of the cluster: enough to keep it busy.
AHEAD = 4
#: Attempts beyond the first for a task whose worker is lost.
RETRIES = 5


def _with_file(text, work):
    # The workers need not see the file system of the client.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "campaign.toml")
        path.write_text(text, encoding="utf-8")
        return work(str(path))


def shard_cases(text, first, end):
    """Outcomes of the cases from `first` to before `end`, each as JSON. Runs on a worker."""
    return _with_file(text, lambda path: _onecycle.campaign_shard(path, first, end))


def _write(path, first, cases):
    import pyarrow
    import pyarrow.parquet

    table = pyarrow.table({
        "n": pyarrow.array(range(first, first + len(cases)), pyarrow.uint64()),
        "case": pyarrow.array(cases, pyarrow.string()),
    })
    part = path.with_suffix(".tmp")
    pyarrow.parquet.write_table(table, part)
    os.replace(part, path)


def _read(path):
    import pyarrow.parquet

    return pyarrow.parquet.read_table(path).column("case").to_pylist()


def _folder(out, text, shard):
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    stated = json.dumps({"version": _onecycle.__version__, "shard": shard, "recipe": text})
    settings = folder / "settings.json"
    if not settings.exists():
        settings.write_text(stated, encoding="utf-8")
    elif settings.read_text(encoding="utf-8") != stated:
        raise _onecycle.OnecycleError(
            f"{folder} holds the results of another recipe, shard or version: name another folder"
        )
    return folder


def run(recipe, client=None, out=None, shard=64):
    """Outcomes of all cases in order, as dictionaries: `cases` of `onecycle campaign FILE --json`.

    `recipe` is the path of a TOML file. `out` is a folder for one Parquet file for each shard; finished shards found
    there are not computed again.
    """
    from distributed import Client, as_completed

    if shard < 1:
        raise _onecycle.OnecycleError(f"a shard of {shard} cases is empty: use 1 or more")
    count = _onecycle.campaign_cases(os.fspath(recipe))
    text = Path(recipe).read_text(encoding="utf-8")
    folder = None if out is None else _folder(out, text, shard)
    part = (lambda first: folder / f"part-{first:09}.parquet") if folder else None
    done = {}
    for first in range(0, count, shard):
        if part and part(first).exists():
            done[first] = _read(part(first))
    left = iter([first for first in range(0, count, shard) if first not in done])
    own = Client() if client is None else None
    client = client or own
    firsts = {}

    def submit():
        first = next(left, None)
        if first is None:
            return None
        task = client.submit(
            shard_cases, text, first, min(first + shard, count), retries=RETRIES, pure=False
        )
        firsts[task.key] = first
        return task

    try:
        ahead = AHEAD * max(1, sum(client.nthreads().values()))
        tasks = as_completed([task for task in (submit() for _ in range(ahead)) if task])
        for task in tasks:
            first = firsts.pop(task.key)
            done[first] = task.result()
            if part:
                _write(part(first), first, done[first])
            following = submit()
            if following:
                tasks.add(following)
    finally:
        if own:
            own.close()
    return [json.loads(case) for first in sorted(done) for case in done[first]]
