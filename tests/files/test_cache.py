"""The cache: used, made anew for other content, mended where damaged, and not needed."""

import numpy as np

from lutgen.files import cache


def test_it_is_used_mended_and_not_needed(tmp_path, monkeypatch):
    monkeypatch.setenv("LUTGEN_CACHE", str(tmp_path / "cache"))
    calls = []

    def make() -> dict:
        calls.append(1)
        return {"a": np.arange(3)}

    for _ in range(2):
        assert cache.load_or_make("thing", ("files/cache",), make)["a"].tolist() == [0, 1, 2]
    assert len(calls) == 1
    (path,) = (tmp_path / "cache").iterdir()
    path.write_bytes(b"damaged")
    assert cache.load_or_make("thing", ("files/cache",), make)["a"].tolist() == [0, 1, 2]
    assert len(calls) == 2
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LUTGEN_CACHE", str(tmp_path / "file" / "below"))
    assert cache.load_or_make("thing", ("files/cache",), make)["a"].tolist() == [0, 1, 2]


def test_other_arrays_and_other_sources_are_other_things(tmp_path, monkeypatch):
    monkeypatch.setenv("LUTGEN_CACHE", str(tmp_path))
    mesh, other = np.zeros((4, 3)), np.zeros((4, 3))
    other[2, 1] = 1e-12
    entries = [
        cache.load_or_make("thing", modules, lambda k=k: {"a": np.array(k)}, array)["a"].item()
        for k, (modules, array) in enumerate(
            [
                (("files/cache",), mesh),
                (("files/cache",), other),
                (("errors",), mesh),
                (("files/cache",), mesh.reshape(3, 4)),
            ]
        )
    ]
    assert entries == [0, 1, 2, 3]
    assert cache.load_or_make("thing", ("files/cache",), lambda: {"a": np.array(9)}, mesh)["a"] == 0
