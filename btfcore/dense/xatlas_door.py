"""The door to xatlas and to libigl's decimation, both of which may crash or hang.

These functions run only inside `btfcore.guard`'s child process and import no more than they
need, since the child starts anew for every mesh.
"""

from __future__ import annotations

import numpy as np

from btfcore.errors import AtlasFailed
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
    pack_options.resolution = 512  # the packing is not used, but it rounds charts to texels
    pack_options.rotate_charts = False
    pack_options.rotate_charts_to_axis = False
    atlas.generate(chart_options, pack_options)
    mapping, corners, place = atlas.get_mesh(0)
    corners = corners.astype(np.int64).reshape(-1, 3)
    if corners.shape != faces.shape or not np.array_equal(mapping[corners], faces):
        raise AtlasFailed(f"xatlas returned {len(corners)} other faces for {len(faces)}")
    uv = place[corners].astype(np.float64) * [atlas.width, atlas.height]
    chart = np.full(len(faces), -1, np.int32)
    for index in range(atlas.get_mesh_chart_count(0)):
        chart[np.asarray(atlas.get_mesh_chart(0, index).faces, np.int64)] = index
    return {"uv": uv, "chart": chart}, {}


def chart_proxy(arrays: Arrays, options: Options) -> tuple[Arrays, Options]:
    """Decimate a mesh to about `faces` faces (option), then cut that proxy into charts.

    Returns what `chart_mesh` does, for the proxy; its vertices and faces; and nearest (F,)
    i4, the proxy face nearest to the middle of every face of the mesh.
    """
    import igl

    vertices, faces = arrays["vertices"], arrays["faces"]
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    size = max(float(np.abs(vertices - centre).max()), np.finfo(float).tiny)
    points = (vertices - centre) / size
    few, triangles, _, _ = igl.decimate(
        np.asfortranarray(points), np.asfortranarray(faces, np.int32), int(options["faces"])
    )
    corner = few[triangles]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    triangles = np.ascontiguousarray(triangles[np.linalg.norm(area, axis=1) > 1e-14])
    if len(triangles) == 0:
        raise AtlasFailed(f"nothing is left of {len(faces)} faces after decimation")
    few = np.ascontiguousarray(few)
    proxy = {"vertices": few, "faces": triangles.astype(np.int32)}
    charted, _ = chart_mesh(proxy, options)
    middle = points[faces].mean(axis=1)
    _, nearest, _ = igl.point_mesh_squared_distance(middle, few, triangles.astype(np.int64))
    proxy["vertices"] = few * size + centre
    return {**charted, **proxy, "nearest": nearest.astype(np.int32)}, {}
