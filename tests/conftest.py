"""Shared sets, baked once per run."""

import pytest

import lutgen
from lutgen import manifest


@pytest.fixture(scope="session")
def draft():
    """A small set with the default recipe's axes."""
    return lutgen.bake({"photons": 16_384, "seed": 5})


@pytest.fixture(scope="session")
def draft_dir(draft, tmp_path_factory):
    """The same set on disk."""
    return manifest.save(draft, tmp_path_factory.mktemp("luts") / "draft")
