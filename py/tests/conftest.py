"""What the tests share."""

import os
import subprocess
from pathlib import Path

import pytest

import onecycle

ROOT = Path(__file__).parents[2]
HOVER = "examples/simulated_hover.csv"


@pytest.fixture
def root(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.fixture(scope="session")
def found():
    """A report that tests only read."""
    return onecycle.identify(onecycle.read(ROOT / HOVER))


@pytest.fixture(scope="session")
def program():
    def run(*words):
        return subprocess.run([os.environ["ONECYCLE"], *words], capture_output=True, text=True, cwd=ROOT).stdout

    return run
