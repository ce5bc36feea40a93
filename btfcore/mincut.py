"""Minimum cuts: the only door to PyMaxflow (Boykov & Kolmogorov 2004)."""

from __future__ import annotations

import maxflow
import numpy as np
from numpy.typing import NDArray

from btfcore.types import F8, I4


def minimum_cut(
    nodes: int, tail: I4, head: I4, forward: F8, backward: F8, source: F8, sink: F8
) -> tuple[float, NDArray[np.bool_]]:
    """Cheapest cut of a directed graph.

    tail, head (m,) i4 with capacities forward (tail→head) and backward (head→tail), f8 ≥ 0;
    source, sink (nodes,) f8: capacities from the source and to the sink.
    Returns (flow, side (nodes,) bool: True where the node falls to the sink).
    """
    graph = maxflow.Graph[float](nodes, len(tail))
    names = graph.add_nodes(nodes)
    graph.add_edges(tail, head, forward, backward)
    graph.add_grid_tedges(names, source, sink)
    flow = graph.maxflow()
    return float(flow), np.asarray(graph.get_grid_segments(names), bool)
