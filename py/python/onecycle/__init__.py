"""From a recording of a control loop to a process model with 90 % intervals and a controller.

    found = onecycle.identify("flight.csv")
    print(found)
    found.model.frequency_response([1.0, 10.0])

Keywords are the settings of a request, the options of `onecycle identify` with underscores: `structure="foptd"`,
`sample_rate=100`. Sentences name them in backticks.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from . import _model, _onecycle
from ._model import Controller, Interval, Margins, Model, margins, simulate, step
from ._onecycle import OnecycleError, __version__
from ._options import CampaignOptions, DesignOptions, ExperimentOptions, FlightOptions, IdentifyOptions, ReadOptions, as_keywords, keywords, settings
from ._recording import Recording
from ._report import Answer, Bands, Design, Flight, Gain, Report, bare

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    from typing_extensions import Unpack

    from ._cluster import Outcomes

    Source = Recording | str | os.PathLike[str]

__all__ = [
    "Answer", "Bands", "Controller", "Design", "Flight", "Gain", "Interval", "Margins", "Model", "OnecycleError", "Recording", "Report",
    "__version__", "campaign", "dataset", "design", "expect", "experiment", "identify", "identify_flight", "identify_many", "margins", "read", "simulate", "step",
]


@keywords(ReadOptions)
def read(path: str | os.PathLike[str], **options: Unpack[ReadOptions]) -> Recording:
    """Reads a table, or a loop of a flight log: `read("flight.ulg", axis="roll", loop="rate")`. Of a flight log it is the part
    that tells most about the loop, or the one that `from_` and `to` choose. OnecycleError if the file makes no recording."""
    return Recording._of(os.fspath(path), _onecycle.read(path, settings("read", ReadOptions, options)))


@keywords(IdentifyOptions)
def identify(recording: Source, **options: Unpack[IdentifyOptions]) -> Report:
    """Identifies from a `Recording` or from a file. Of a flight log, choose a loop: `axis="roll"`, `loop="rate"`; its gains
    in force are judged too.

    A process that cannot be identified is a result: `report.model` is None and `report.refusal` says why. OnecycleError if a file
    makes no recording, or keywords contradict each other or do not go with the recording."""
    return Report("identify", recording, settings("identify", IdentifyOptions, options))


@keywords(IdentifyOptions)
def identify_many(recordings: Iterable[Source], n_jobs: int = -1, **options: Unpack[IdentifyOptions]) -> list[Report]:
    """`identify` of each with the same keywords, on `n_jobs` threads (-1: one for each core), in their order and with the same
    results. The first that cannot be used raises its OnecycleError. A report takes about 1 MB."""
    if n_jobs == 0 or n_jobs < -1:
        raise ValueError(f"n_jobs is {n_jobs}: give a number of threads, or -1 for one for each core")
    sources = list(recordings)
    asked = settings("identify_many", IdentifyOptions, options)
    found = _onecycle.identify_many([bare(source) for source in sources], max(n_jobs, 0), asked)
    return [Report("identify", source, asked, inner) for source, inner in zip(sources, found)]


@keywords(FlightOptions)
def identify_flight(path: str | os.PathLike[str], **options: Unpack[FlightOptions]) -> Flight:
    """Identifies every loop of a flight log from the parts of the flight worth using. OnecycleError if it is no flight log."""
    return Flight("identify_flight", path, settings("identify_flight", FlightOptions, options))


@keywords(DesignOptions)
def design(model: Model, **options: Unpack[DesignOptions]) -> Design:
    """Controllers of a known process: `design(model, controller="pi", style="calm").controller`. OnecycleError if none keeps the
    limits."""
    return Design("design", model, settings("design", DesignOptions, options))


@keywords(ExperimentOptions)
def experiment(model: Model, **options: Unpack[ExperimentOptions]) -> Recording:
    """Simulates a test of a process exactly, with the relay of the firmware or any other signal, in an open or a closed loop:
    `experiment(model, noise="1%", bias="30%", seed=7)`. It is `onecycle simulate`; OnecycleError if a keyword is out of its range, or the
    package was built without the program."""
    return _model.experiment(model, options)


@keywords(ExperimentOptions)
def expect(model: Model, **options: Unpack[ExperimentOptions]) -> Mapping[str, Interval]:
    """The 90 % intervals to expect from a test, before it is run: the Cramer-Rao bound, which an efficient estimator reaches. It is
    `onecycle simulate --expect`, needs `noise`, and takes gusts as `disturbance`; OnecycleError as of `experiment`."""
    return _model.expect(model, options)


@keywords(CampaignOptions)
def campaign(
    recipe: str | os.PathLike[str],
    client: Any = None,
    out: str | os.PathLike[str] | None = None,
    shard: int | None = None,
    progress: Callable[[int, int], object] | None = None,
    measure: Callable[[Recording, dict[str, Any]], Any] | None = None,
    **options: Unpack[CampaignOptions],
) -> Outcomes:
    """Runs a campaign (a TOML file) on Dask and returns its outcomes.

    `client` is a `distributed.Client`; without one, workers are started on this machine. A task is `shard` cases, or some seconds
    of work. In the folder `out` every task leaves a Parquet file, together one table while it grows, and cases found there are not
    computed again: the same call resumes, one with more `cases` extends. `progress(done, count)` is called after each task.

    `measure(recording, truth)` is called for every case instead of the measure of the file, and returns its outcome: a number or a
    dict of numbers, truth values and texts. `truth` has the structure and the parameters of the process. A case without recording,
    as one whose output runs away, has the outcome None.

    OnecycleError if the file or a keyword cannot be used, no worker has the build of the client, or the scheduler is lost.
    """
    from ._cluster import run

    words = [f"--{name.replace('_', '-')}={text}" for name, text in settings("campaign", CampaignOptions, options)]
    try:
        return run(recipe, client, out, shard, progress, tuple(words), measure)
    except OnecycleError as error:
        error.args = (as_keywords(str(error)),)
        raise


def dataset(
    recipe: str | os.PathLike[str] | None,
    examples: int | None,
    into: str | os.PathLike[str],
    client: Any = None,
    progress: Callable[[int, int], object] | None = None,
    restart: bool = False,
) -> Path:
    """Makes a training set on Dask in the folder `into`: the files of `onecycle-lab dataset`, to the bit.

    `recipe` is a TOML file, or None for the paper's multirotors, and `examples` the number of experiments; None for the recipe of the
    paper's classifier, which says it. The same call resumes an interrupted run.
    """
    from ._cluster import fill

    return fill(recipe, examples, into, client, progress, restart)
