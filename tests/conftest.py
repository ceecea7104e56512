"""Shared sets, baked once per run; what every test of the viewer must leave behind: nothing."""

import os
import sys
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is there: each worker has one of two cores

import pytest

import lutgen
from lutgen.exports.resampled import Source
from lutgen.tables import recipe as recipes
from lutgen.tables import storage


@pytest.fixture(scope="session")
def draft():
    """A set of draft quality."""
    return lutgen.bake(replace(recipes.quality("draft"), seed=5))


@pytest.fixture(scope="session")
def draft_dir(draft, tmp_path_factory):
    """The same set on disk."""
    return storage.save(draft, tmp_path_factory.mktemp("luts") / "draft")


@pytest.fixture(scope="session")
def source():
    """What exports of the default set start from."""
    return Source(lutgen.load(), 31)


def _gl(module):
    """The viewer's `gl` where a test module uses the viewer and a context is open, else None."""
    uses = any(getattr(value, "__name__", "").startswith("lutgen.viewer") for value in vars(module).values())
    gl = sys.modules.get("lutgen.viewer.gl")
    return gl if uses and gl is not None and gl._CONTEXTS else None


@pytest.fixture(autouse=True, scope="module")
def _nothing_stays_on_the_gpu(request):
    """A module that frees what its fixtures made leaves as many objects in the context as it found, queries apart."""
    before = None
    if _gl(request.module):
        import gl_objects

        before = gl_objects.alive()
    yield
    if _gl(request.module):
        import gl_objects

        left = {one for one in gl_objects.alive() - (before or set()) if one[0] != "Query"}
        assert not left, f"left on the GPU: {sorted(left)}"


@pytest.fixture(autouse=True)
def _nothing_is_lost_on_the_gpu(request):
    """After a test of the viewer: no error pending, no object that no one can free any more, one context at most."""
    before = None
    if _gl(request.module):
        import gl_objects

        before = gl_objects.orphans()
    yield
    gl = _gl(request.module)
    if gl:
        import gl_objects

        gl.check()
        lost = gl_objects.orphans() - (before or set())
        assert not lost, f"lost on the GPU: {sorted(lost)}"
        assert gl_objects.held()[2] == 1, "one OpenGL context per process: the older of two reads zeros"
