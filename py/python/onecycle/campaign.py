"""`python -m onecycle.campaign FILE --scheduler ADDRESS --out FOLDER`: a campaign on a cluster."""

import argparse
import sys


def main():
    parser = argparse.ArgumentParser(prog="python -m onecycle.campaign", description=__doc__)
    parser.add_argument("file", help="file of the campaign (TOML)")
    parser.add_argument("--scheduler", help="address of a Dask scheduler (default: workers on this machine)")
    parser.add_argument("--out", required=True, help="folder of the results; an interrupted run is resumed from it")
    parser.add_argument("--shard", type=int, default=64, help="cases of a task (default 64)")
    arguments = parser.parse_args()
    from distributed import Client

    from onecycle import OnecycleError
    from onecycle._cluster import run

    try:
        with Client(arguments.scheduler) as client:
            cases = run(arguments.file, client=client, out=arguments.out, shard=arguments.shard)
    except (OnecycleError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 3
    print(f"{len(cases)} cases in {arguments.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
