"""`python -m onecycle ...`: the program `onecycle`, which is in the wheel."""

import os
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

from ._onecycle import OnecycleError


def program(name: str = "onecycle") -> Path:
    """The program that was installed with the package of its name. OnecycleError if the package was built without it."""
    try:
        installed = files(name) or []
    except PackageNotFoundError:
        installed = []
    for file in installed:
        if file.name in (name, f"{name}.exe") and file.parent.name in ("bin", "Scripts"):
            path = Path(str(file.locate())).resolve()
            if path.exists():
                return path
    raise OnecycleError(f"this package was built without the program {name}: install a wheel of a release or of py/wheel.sh")


def main(name: str = "onecycle") -> int:
    try:
        path = program(name)
    except OnecycleError as error:
        print(f"error: {error}", file=sys.stderr)
        return 3
    words = [str(path), *sys.argv[1:]]
    if sys.platform == "win32":
        return subprocess.run(words).returncode
    os.execv(path, words)


if __name__ == "__main__":
    sys.exit(main())
