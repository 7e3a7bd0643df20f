"""`python -m onecycle.campaign FILE --scheduler ADDRESS --out FOLDER`: a campaign or a training set on a cluster."""

import argparse
import logging
import sys
import warnings


def _bar(done: int, count: int) -> None:
    if sys.stderr.isatty():
        end = "\n" if done >= count else ""
        print(f"\r{done} of {count}", end=end, file=sys.stderr, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m onecycle.campaign",
        description="Runs a campaign, or with --examples or --sets a training set, on Dask workers. The same command resumes an "
        "interrupted run, one with more --cases extends it.",
        epilog="Options that are not listed are those of `onecycle-lab campaign`, such as --cases=1000.",
    )
    parser.add_argument("file", help="file of the campaign, or recipe of the training set (TOML)")
    parser.add_argument("--scheduler", help="address of a Dask scheduler (default: workers on this machine)")
    parser.add_argument("--out", required=True, help="folder of the results")
    parser.add_argument("--shard", type=int, help="cases of a task (default: some seconds of work)")
    parser.add_argument("--examples", type=int, help="makes a training set of this number of experiments")
    parser.add_argument("--sets", action="store_true", help="makes the sets of the paper's classifier, whose recipe says how many")
    parser.add_argument("--json", action="store_true", help="print the outcome of every case instead of the table")
    arguments, options = parser.parse_known_args()
    is_training = arguments.sets or arguments.examples is not None
    if is_training and options:
        parser.error(f"a training set has no option {options[0]}")

    from distributed import Client

    from onecycle import OnecycleError
    from onecycle._cluster import fill, run

    # A lost scheduler is told in a sentence, and so is a worker that is left out.
    logging.disable(logging.CRITICAL)
    warnings.showwarning = lambda message, *_, **__: print(f"note: {message}", file=sys.stderr)
    try:
        with Client(arguments.scheduler) as client:  # type: ignore[no-untyped-call]
            if is_training:
                fill(arguments.file, arguments.examples, arguments.out, client, _bar)
                print(f"the training set is in {arguments.out}")
                return 0
            outcomes = run(arguments.file, client, arguments.out, arguments.shard, _bar, tuple(options))
        print(outcomes.to_json() if arguments.json else str(outcomes), end="")
    except (OnecycleError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 3
    except KeyboardInterrupt:
        print("interrupted: the same command goes on with what is finished", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
