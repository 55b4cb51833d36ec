"""Where things are, and what is skipped without them."""

import os
import pathlib
import sys

import pytest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
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
        pytest.skip("no shared data: set IMPINGE_DATA to the folder that holds it")
    return path
