"""Shared sets, baked once per run."""

from dataclasses import replace

import pytest

import lutgen
from lutgen import config, manifest


@pytest.fixture(scope="session")
def draft():
    """A set of draft quality."""
    return lutgen.bake(replace(config.quality("draft"), seed=5))


@pytest.fixture(scope="session")
def draft_dir(draft, tmp_path_factory):
    """The same set on disk."""
    return manifest.save(draft, tmp_path_factory.mktemp("luts") / "draft")
