"""A tree of boxes over triangles, W children a node and W triangles a leaf: one ray meets W of them at a time.

Built as a binary tree by the surface-area heuristic over 16 bins (Wald 2007), then collapsed: a node takes its
largest children's children until it has W (Dammertz, Hanika & Keller 2008).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BINS = 16
_FAR = np.float32(1e30)


@dataclass(frozen=True)
class Bvh:
    """Boxes [N, 6, W] (low x, y, z, high x, y, z), children [N, W] (a node, or ~ of a leaf) and leaves: corner and two
    edges [L, 9, W] of triangles, their numbers [L, W] (-1: none). Node 0 is the root; empty lanes no ray meets."""

    boxes: np.ndarray
    children: np.ndarray
    triangles: np.ndarray
    numbers: np.ndarray

    @property
    def width(self) -> int:
        """Children of a node, W."""
        return self.children.shape[1]


def build(positions: np.ndarray, triangles: np.ndarray, width: int) -> Bvh:
    """The tree over triangles [T, 3] of positions [V, 3] for nodes of `width` children.

    >>> tree = build(np.eye(3), np.array([[0, 1, 2]]), 4)
    >>> tree.children.tolist(), tree.numbers.tolist()
    ([[-1, 0, 0, 0]], [[0, -1, -1, -1]])
    """
    corners = positions[triangles].astype("f4")
    bounds = np.concatenate([corners.min(axis=1), -corners.max(axis=1)], axis=1)  # both ends as minima
    low, high, kids, leaf_of = _binary(bounds, width)
    size = _area(low, high)
    boxes, children, leaves = [], [], []

    def collapsed(root: int) -> int:
        """The number of the wide node that a binary node becomes."""
        me = len(boxes)
        box, child = np.repeat([[_FAR]] * 3 + [[-_FAR]] * 3, width, axis=1), np.zeros(width, "i4")
        boxes.append(box)
        children.append(child)
        below = [root] if root in leaf_of else list(kids[root])
        while len(below) < width:
            inner = [k for k in below if k not in leaf_of]
            if not inner:
                break
            largest = max(inner, key=lambda k: size[k])
            below.remove(largest)
            below += kids[largest]
        for lane, k in enumerate(below):
            box[:3, lane], box[3:, lane] = low[k], high[k]
            if k in leaf_of:
                child[lane] = ~len(leaves)
                leaves.append(leaf_of[k])
            else:
                child[lane] = collapsed(k)
        return me

    collapsed(0)
    shapes = np.zeros((len(leaves), 9, width), "f4")
    numbers = np.full((len(leaves), width), -1, "i4")
    for i, ids in enumerate(leaves):
        a, b, c = corners[ids].transpose(1, 2, 0)
        shapes[i, :, : len(ids)] = np.concatenate([a, b - a, c - a])
        numbers[i, : len(ids)] = ids
    return Bvh(np.array(boxes, "f4"), np.array(children), shapes, numbers)


def _binary(bounds: np.ndarray, width: int):
    """Low and high corners [N, 3] of the nodes, two children of the inner ones, triangles of the leaves."""
    middles = (bounds[:, :3] - bounds[:, 3:]) / 2
    boxes, kids, leaf_of = [], {}, {}
    waiting = [(np.arange(len(bounds)), -1)]
    while waiting:
        ids, parent = waiting.pop()
        me = len(boxes)
        boxes.append(bounds[ids].min(axis=0))
        if parent >= 0:
            kids.setdefault(parent, []).append(me)
        if len(ids) <= width:
            leaf_of[me] = ids
        else:
            waiting += [(part, me) for part in _split(ids, bounds, middles[ids], width)]
    ends = np.array(boxes)
    return ends[:, :3], -ends[:, 3:], kids, leaf_of


def _split(ids: np.ndarray, bounds: np.ndarray, middles: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Both parts of the best of all splits between bins; halves in order where all middles coincide."""
    low, span = middles.min(axis=0), np.ptp(middles, axis=0)
    best, parts = np.inf, None
    for axis in np.flatnonzero(span > 0):
        which = np.minimum((middles[:, axis] - low[axis]) * (BINS / span[axis]), BINS - 1).astype(int)
        order = np.argsort(which, kind="stable")
        count = np.bincount(which, minlength=BINS)
        ends = np.full((BINS, 6), _FAR)
        filled = np.flatnonzero(count)
        starts = (np.cumsum(count) - count)[filled]
        ends[filled] = np.minimum.reduceat(bounds[ids[order]], starts)
        left, right = np.minimum.accumulate(ends), np.minimum.accumulate(ends[::-1])[::-1]
        below = np.cumsum(count)[:-1]
        blocks = [np.ceil(n / width) for n in (below, len(ids) - below)]  # W triangles cost what one does
        cost = _area(left[:-1, :3], -left[:-1, 3:]) * blocks[0] + _area(right[1:, :3], -right[1:, 3:]) * blocks[1]
        cost = np.where((below > 0) & (below < len(ids)), cost, np.inf)
        at = int(cost.argmin())
        if cost[at] < best:
            best, parts = cost[at], which <= at
    if parts is None:
        half = len(ids) // 2
        return ids[:half], ids[half:]
    return ids[parts], ids[~parts]


def _area(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Half the surface of boxes."""
    x, y, z = np.maximum(high - low, 0).T
    return x * y + y * z + z * x
