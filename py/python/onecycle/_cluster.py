"""Campaigns and training sets on Dask.

A task is a range of cases, and a case depends on the recipe and its number only: the results are the same bits for any
number of workers, in any order, on any machine with the same package.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import platform
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _onecycle
from ._recording import Recording
from ._table import Folder, cells_of, read

try:
    import onecycle_lab as _lab
except ImportError as error:
    raise _onecycle.OnecycleError("campaigns need the package onecycle-lab: pip install ./research/py") from error

if TYPE_CHECKING:
    import pandas

    from ._table import Row

    Client = Any
    Progress = Callable[[int, int], object] | None
    StrPath = str | os.PathLike[str]
    Own = Callable[[Recording, dict[str, Any]], Any] | None
    Build = tuple[str, str, str]

#: Tasks sent ahead for each thread of the cluster: enough to keep it busy.
AHEAD = 4
#: Time that a task of many cases should take (s): the scheduler's part of it, some 3 ms, is small; and the least, at the end.
TASK_S, LEAST_S = 3.0, 0.3
#: Time that the client needs for a task and its file (s), with room: it is one for all workers.
CLIENT_S = 0.04
#: Attempts beyond the first for a task that fails on its worker, as for want of memory. Lost workers are Dask's own affair.
RETRIES = 2
#: Experiments of a task of a classifier's sets: a second or two of work.
EXAMPLES = 500


@lru_cache(maxsize=8)
def _campaign(text: str, options: tuple[str, ...]) -> Any:
    # The workers need not see the file system of the client.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "campaign.toml")
        path.write_text(text, encoding="utf-8")
        return _lab.Campaign(str(path), list(options))


@lru_cache(maxsize=1)
def build() -> Build:
    """The version of the package, the kind of machine, and the hash of the compiled code of both packages."""
    code = hashlib.sha256()
    for module in (_onecycle, _lab._lab):
        code.update(Path(str(module.__file__)).read_bytes())
    return _onecycle.__version__, f"{platform.system()} {platform.machine()}", code.hexdigest()


def _difference(of_client: Build, of_worker: Build | Exception, where: str) -> str | None:
    """Why a worker is left out: it has another version; on a machine of the same kind, other code; or no package."""
    if isinstance(of_worker, Exception):
        return f"the worker {where} cannot load onecycle and onecycle-lab ({of_worker})"
    (version, machine, code), (its_version, its_machine, its_code) = of_client, of_worker
    if its_version == version and (its_machine != machine or its_code == code):
        return None
    return f"the worker {where} has another build of onecycle ({its_version}, {its_code[:8]}) than the client ({version}, {code[:8]})"


@dataclass(frozen=True)
class _Refused:
    """What a worker that cannot work on a task returns."""

    worker: str
    sentence: str


def checked(of_client: Build, task: Callable[..., Any], *words: Any) -> Any:
    """`task(*words)`, if this worker has the build of the client. Runs on a worker."""
    import distributed

    at = str(distributed.get_worker().address)
    sentence = _difference(of_client, build(), at)
    return _Refused(at, sentence) if sentence else task(*words)


def _plain(value: Any) -> Any:
    """A scalar or an array of NumPy for JSON."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _measured(campaign: Any, n: int, own: Callable[[Recording, dict[str, Any]], Any]) -> Row:
    columns, truth = campaign.recording(n)
    # Without a recording, as of a process that runs away, there is nothing to measure.
    outcome = None if columns is None else own(Recording(*columns, name=f"case {n}"), json.loads(truth))
    return [json.dumps({"outcome": outcome}, default=_plain), truth]


def shard_cases(text: str, options: tuple[str, ...], first: int, end: int, own: Own = None) -> tuple[float, list[Row]]:
    """The cases from `first` to before `end`, and the time that they took (s). Runs on a worker."""
    campaign = _campaign(text, options)
    begin = time.perf_counter()
    rows = campaign.cases(first, end) if own is None else [_measured(campaign, n, own) for n in range(first, end)]
    return time.perf_counter() - begin, rows


def _gaps(done: dict[int, int], count: int) -> Iterator[tuple[int, int]]:
    """The cases that are missing: the first, and the one after the last. `done` has the numbers of cases from each first one on."""
    at = 0
    for first in sorted(done):
        if at < min(first, count):
            yield at, min(first, count)
        at = max(at, first + done[first])
    if at < count:
        yield at, count


def task_s(threads: int) -> float:
    """Time that a task should take (s): of many workers so long that the client keeps up with them."""
    return max(TASK_S, CLIENT_S * threads)


def _spread(client: Client, tasks: Callable[[int], Any], work: Callable[[Any], tuple[Any, ...]], keep: Callable[[Any, Any], None]) -> None:
    """Computes every task on the workers, with a few more waiting than the cluster has threads, and calls `keep(task, result)` as
    results arrive, in any order. `tasks(threads)` returns the next task, cut for that number of threads; None if there is nothing to
    hand out until another result has arrived. `work(task)` is a function and its arguments. Workers of another build are left out."""
    import distributed
    from distributed.comm.core import CommClosedError

    own: Any = None if client is not None else distributed.Client()  # type: ignore[no-untyped-call]
    client = client or own
    running: dict[str, Any] = {}
    left_out: dict[str, str] = {}

    def leave_out(worker: str, sentence: str) -> None:
        if worker not in left_out:
            left_out[worker] = sentence
            warnings.warn(f"{sentence}: it is left out; install the same packages on both", stacklevel=2)

    def asked(question: Callable[..., Any], *words: Any, **named: Any) -> Any:
        """What the scheduler answers. A connection that times out raises a plain `OSError`, which a file that cannot be kept raises too."""
        try:
            return question(*words, **named)
        except OSError as error:
            raise CommClosedError(str(error)) from error

    def workers() -> dict[str, int]:
        """Threads of the workers that there are now, which come and go."""
        there: dict[str, int] = asked(client.nthreads)
        kept = {worker: threads for worker, threads in there.items() if worker not in left_out}
        if there and not kept:
            raise _onecycle.OnecycleError(f"{next(iter(left_out.values()))}, and no other worker is left: install the same packages on both")
        return kept

    def submitted(task: Any) -> Any:
        only = {"workers": list(workers())} if left_out else {}
        future = client.submit(checked, build(), *work(task), retries=RETRIES, pure=False, **only)
        running[future.key] = task
        return future

    def following() -> list[Any]:
        made: list[Any] = []
        threads = max(1, sum(workers().values()))
        while len(running) < AHEAD * threads and (task := tasks(threads)) is not None:
            made.append(submitted(task))
        return made

    try:
        for worker, of in asked(client.run, build, on_error="return").items():
            if sentence := _difference(build(), of, worker):
                leave_out(worker, sentence)
        futures: Any = distributed.as_completed(following())  # type: ignore[no-untyped-call]
        for future in futures:
            task, result = running.pop(future.key), future.result()
            if isinstance(result, _Refused):
                leave_out(result.worker, result.sentence)
                futures.add(submitted(task))
            else:
                keep(task, result)
            for more in following():
                futures.add(more)
    except (distributed.CancelledError, CommClosedError, ConnectionError, TimeoutError) as error:
        raise _onecycle.OnecycleError(
            "the scheduler is lost: start it again with its workers; the same command goes on with what is finished"
        ) from error
    finally:
        if own:
            own.close()


class Outcomes:
    """Outcomes of all cases of a campaign.

    `len(outcomes)` is the number of cases; `print(outcomes)` shows the table of `onecycle-lab campaign FILE`, or of an own measure
    means and quantiles.
    """

    def __init__(
        self, text: str, options: tuple[str, ...], count: int, parts: dict[int, Path | list[Row]], is_own: bool
    ) -> None:
        self._text, self._options, self._count, self._parts, self._is_own = text, options, count, parts, is_own

    def _rows(self) -> Iterator[Row]:
        """One part in memory at a time."""
        at = 0
        for first in sorted(first for first in self._parts if first < self._count):
            part = self._parts[first]
            # Those that a part before it has too are left out.
            rows = (read(part) if isinstance(part, Path) else part)[at - first : self._count - first]
            at += len(rows)
            yield from rows

    def __len__(self) -> int:
        return self._count

    @property
    def cases(self) -> list[Any]:
        """The outcome of every case."""
        made = [json.loads(case) for case, _ in self._rows()]
        return [case["outcome"] for case in made] if self._is_own else made

    @property
    def truths(self) -> list[dict[str, Any]]:
        """What every case was made of: structure and parameters of the process, and disturbances."""
        return [json.loads(truth) for _, truth in self._rows()]

    def to_json(self) -> str:
        """The text that `onecycle-lab campaign FILE --json` prints."""
        if self._is_own:
            return json.dumps({"cases": self.cases}, indent=2) + "\n"
        return self._told((*self._options, "--json"))

    def _told(self, options: tuple[str, ...]) -> str:
        return str(_campaign(self._text, options).text(case for case, _ in self._rows()))

    def to_pandas(self) -> pandas.DataFrame:
        """One row for each case: its outcome, and its truth in columns that begin with `truth.`."""
        import pandas

        return pandas.DataFrame([cells_of(row) for row in self._rows()]).rename_axis("n")

    def __str__(self) -> str:
        if self._is_own:
            return f"{self.to_pandas().describe().T.to_string()}\n"
        return self._told(self._options)


def _source(own: Own) -> str | None:
    """What tells one measure from another: its source, or its name where that cannot be had."""
    if own is None:
        return None
    try:
        return inspect.getsource(own)
    except (OSError, TypeError):
        return f"{own.__module__}.{getattr(own, '__qualname__', type(own).__name__)}"


def run(
    recipe: StrPath, client: Client = None, out: StrPath | None = None, shard: int | None = None, progress: Progress = None,
    options: tuple[str, ...] = (), own: Own = None,
) -> Outcomes:
    if shard is not None and shard < 1:
        raise _onecycle.OnecycleError(f"a shard of {shard} cases is empty: use 1 or more")
    # Names the file in its errors.
    campaign = _lab.Campaign(os.fspath(recipe), list(options))
    count = len(campaign)
    text = Path(recipe).read_text(encoding="utf-8")
    # Not the number of cases: a finished campaign can be extended.
    decides = {"version": _onecycle.__version__, "settings": json.loads(campaign.settings()), "measure": _source(own)}
    settings = json.dumps(decides)
    folder = None if out is None else Folder(out, settings)
    parts: dict[int, Path | list[Row]] = {}
    gaps = list(_gaps({first: rows for first, (_, rows) in folder.parts.items()} if folder else {}, count))
    missing = sum(end - first for first, end in gaps)
    left, began, timed, took_s = missing, 0, 0, 0.0

    def cases_of_task(threads: int) -> int:
        if shard:
            return shard
        if not timed:
            return 1
        a_second = timed / max(took_s, 1e-6)
        # Smaller ones at the end, so that all workers end at the same time.
        return max(1, int(min(task_s(threads) * a_second, max(LEAST_S * a_second, left / (2 * threads)))))

    def task(threads: int) -> tuple[int, int] | None:
        nonlocal left, began
        # One case for each thread shows how long a case takes.
        if not gaps or (not shard and not timed and began >= threads):
            return None
        first, last = gaps.pop(0)
        end = min(first + cases_of_task(threads), last)
        if end < last:
            gaps.insert(0, (end, last))
        left -= end - first
        began += 1
        return first, end

    def keep(task: tuple[int, int], result: tuple[float, list[Row]]) -> None:
        nonlocal timed, took_s
        first, (seconds, rows) = task[0], result
        if folder:
            # Of a campaign with a folder, no outcome stays in memory.
            folder.add(first, rows)
        else:
            parts[first] = rows
        timed, took_s = timed + len(rows), took_s + seconds
        if progress:
            progress(count - missing + timed, count)

    if missing:
        _spread(client, task, lambda task: (shard_cases, text, options, *task, own), keep)
    if folder:
        parts |= {first: path for first, (path, _) in folder.parts.items()}
    return Outcomes(text, options, count, parts, own is not None)


def dataset_file(manifest: str, number: int) -> Any:
    """Bytes and number of examples of a file of a dataset. Runs on a worker."""
    return _lab.dataset_file(manifest, number)


@lru_cache(maxsize=1)
def _sets(recipe: str) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "recipe.toml")
        path.write_text(recipe, encoding="utf-8")
        return _lab.ClassifierSets(str(path))


def examples_of(recipe: str, number: int, first: int, end: int) -> Any:
    """Inputs, classes and costs of some experiments of a set of a classifier. Runs on a worker."""
    return _sets(recipe).part(number, first, end)


def fill(
    recipe: StrPath | None, examples: int | None, into: StrPath, client: Client = None, progress: Progress = None,
    restart: bool = False,
) -> Path:
    if recipe is not None and _lab.ClassifierSets.is_recipe(os.fspath(recipe)):
        if examples is not None:
            raise _onecycle.OnecycleError("a classifier's recipe says how many experiments there are: leave out `examples`")
        return _fill_sets(os.fspath(recipe), Path(into), client, progress, restart)
    if examples is None:
        raise _onecycle.OnecycleError("give the number of experiments: `examples`")
    words = [f"--examples={examples}", f"--into={os.fspath(into)}"] + ["--restart"] * bool(restart)
    folder = _lab.Dataset(None if recipe is None else os.fspath(recipe), words)
    manifest = folder.manifest()
    missing = folder.missing()
    left = iter(missing)
    kept = 0

    def keep(number: int, made: Any) -> None:
        nonlocal kept
        folder.keep(number, *made)
        kept += 1
        if progress:
            progress(kept, len(missing))

    if missing:
        _spread(client, lambda threads: next(left, None), lambda number: (dataset_file, manifest, number), keep)
    return Path(into)


def _fill_sets(recipe: str, into: Path, client: Client, progress: Progress, restart: bool) -> Path:
    """The sets of the paper's classifier. What is finished waits in a folder beside them."""
    # Names the file in its errors.
    sets = _lab.ClassifierSets(recipe)
    text = Path(recipe).read_text(encoding="utf-8")
    sizes = [size for _, size in sets.sizes()]
    made_of = hashlib.sha256(json.dumps([_onecycle.__version__, text]).encode()).hexdigest()[:16]
    waiting = into / f"part-{made_of}"
    if restart and waiting.exists():
        shutil.rmtree(waiting)
    waiting.mkdir(parents=True, exist_ok=True)

    def path(number: int, first: int) -> Path:
        return waiting / f"{number}-{first}.npz"

    parts = [(number, first, min(first + EXAMPLES, size)) for number, size in enumerate(sizes) for first in range(0, size, EXAMPLES)]
    missing = [part for part in parts if not path(*part[:2]).exists()]
    left, kept = iter(missing), len(parts) - len(missing)

    def keep(part: tuple[int, int, int], made: Any) -> None:
        nonlocal kept
        begun = waiting / "begun"
        with begun.open("wb") as file:
            np.savez(file, *made)
        begun.replace(path(*part[:2]))
        kept += 1
        if progress:
            progress(kept, len(parts))

    if missing:
        _spread(client, lambda threads: next(left, None), lambda part: (examples_of, text, *part), keep)

    def whole(number: int) -> tuple[Any, ...]:
        files = [np.load(path(*part[:2])) for part in parts if part[0] == number]
        return tuple(np.concatenate([file[name] for file in files]) for name in ("arr_0", "arr_1", "arr_2"))

    sets.write(str(into), [whole(number) for number in range(len(sizes))])
    shutil.rmtree(waiting)
    return into
