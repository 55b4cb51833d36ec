"""Where things are, and what is skipped without them."""

import os
import pathlib
import sys

import pytest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))


@pytest.fixture(scope="session")
def root():
    """The root of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def data():
    """The folder with meshes and answers that were not made by this project."""
    path = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    if not path.is_dir():
        if os.environ.get("IMPINGE_NO_DATA") == "1":
            pytest.skip("no shared data, as IMPINGE_NO_DATA=1 allows")
        pytest.fail(f"no shared data at {path}: set IMPINGE_DATA, or IMPINGE_NO_DATA=1 to go without")
    return path
