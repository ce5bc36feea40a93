"""The door to xatlas; `chart_mesh` runs only inside `btfcore.guard`'s child process."""

from __future__ import annotations

import numpy as np

from btfcore.guard import Arrays, Options


def chart_mesh(arrays: Arrays, options: Options) -> tuple[Arrays, Options]:
    """Cut vertices (V, 3), faces (F, 3) into charts, each flattened by itself.

    Options: `max_cost`, xatlas's bound on a chart's cost (larger: fewer, more curved charts).
    Returns uv (F, 3, 2) f8 of arbitrary scale and chart (F,) i4, -1 for a face without chart.
    """
    import xatlas

    vertices, faces = arrays["vertices"], arrays["faces"]
    centred = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    centred /= max(float(np.abs(centred).max()), np.finfo(float).tiny)
    atlas = xatlas.Atlas()
    atlas.add_mesh(centred.astype(np.float32), faces.astype(np.uint32))
    chart_options = xatlas.ChartOptions()
    chart_options.max_cost = float(options["max_cost"])
    pack_options = xatlas.PackOptions()
    pack_options.resolution = 512  # finer than we need: charts are rounded to whole texels
    pack_options.rotate_charts = False
    pack_options.rotate_charts_to_axis = False
    atlas.generate(chart_options, pack_options)
    _, corners, place = atlas.get_mesh(0)
    uv = place[corners.astype(np.int64)].astype(np.float64) * [atlas.width, atlas.height]
    chart = np.full(len(faces), -1, np.int32)
    for index in range(atlas.get_mesh_chart_count(0)):
        chart[np.asarray(atlas.get_mesh_chart(0, index).faces, np.int64)] = index
    return {"uv": uv.reshape(-1, 3, 2), "chart": chart}, {}
