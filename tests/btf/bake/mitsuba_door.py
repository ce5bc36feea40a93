"""The same relief as a triangle mesh in Mitsuba 3, asked ray by ray; needs `mitsuba`."""

import tempfile
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from btfcore.btf.bake.shade import LOWEST
from btfcore.btf.bake.slopes import normals_of_slopes, slopes_of_height

DIFFUSE = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}


class Scene:
    """A tiling height field (h, w) in texels as triangles, and rays to its middle tile.

    Texel (row, column) lies at (column, -row, height); `margin` texels of neighbours surround
    the tile. Every cell is cut into fine² squares of its bilinear surface, each of two
    triangles; vertices carry the normals of central differences, interpolated alike.
    """

    def __init__(self, height, *, margin=32, bsdf=DIFFUSE, fine=1):
        import mitsuba

        mitsuba.set_variant("scalar_rgb")
        self.mi = mitsuba
        self.height = height.astype(np.float64)
        self.level = (self.height.mean(), self.height.max())
        normal = normals_of_slopes(slopes_of_height(self.height, tiles=True))
        parts = np.concatenate([self.height[..., None], normal], axis=2)
        rows, columns = self.height.shape
        row = np.arange(-margin * fine, (rows + margin) * fine + 1) / fine
        column = np.arange(-margin * fine, (columns + margin) * fine + 1) / fine
        grid = np.meshgrid(row, column, indexing="ij")
        wide = [map_coordinates(part, grid, order=1, mode="grid-wrap") for part in _axes(parts)]
        points = np.stack([grid[1], -grid[0], wide[0]], axis=-1).reshape(-1, 3)
        normal = np.stack(wide[1:], axis=-1).reshape(-1, 3)
        number = np.arange(len(points)).reshape(grid[0].shape)
        a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
        faces = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)]).reshape(-1, 3)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "relief.ply"
            _write(path, points, normal, faces)
            self.mesh = mitsuba.load_dict({"type": "ply", "filename": str(path), "bsdf": bsdf})
        self.scene = mitsuba.load_dict({"type": "scene", "mesh": self.mesh})

    def sight(self, view):
        """Rays (H * W of them) along the lines of sight through the texels of the mean plane."""
        mean, top = self.level
        rise = top - mean + 1
        run = view[:2] / max(view[2], LOWEST)
        way = -np.array([*run, 1.0])
        way /= np.linalg.norm(way)
        rows, columns = self.height.shape
        for row in range(rows):
            for column in range(columns):
                yield self._ray([column + run[0] * rise, -row + run[1] * rise, mean + rise], way)

    def seen(self, view, lights):
        """Points seen (H, W, 3) f8, whether lights are hidden from them, cosines (L, H, W)."""
        points, hidden, cosine = [], [], []
        for ray in self.sight(view):
            hit = self.scene.ray_intersect(ray)
            assert hit.is_valid(), "a ray slipped between triangles"
            points.append(np.array(hit.p))
            facet, normal = np.array(hit.n), np.array(hit.sh_frame.n)
            hidden.append(
                [
                    facet @ light <= 0 or self.scene.ray_test(hit.spawn_ray(self._vector(light)))
                    for light in lights
                ]
            )
            cosine.append(lights @ normal)
        rows, columns = self.height.shape
        shape = (len(lights), rows, columns)
        hidden, cosine = np.array(hidden).T.reshape(shape), np.array(cosine).T.reshape(shape)
        return np.array(points, np.float64).reshape(rows, columns, 3), hidden, cosine

    def radiance(self, view, light, *, depth=2, samples=1, seed=0):
        """Radiance (H, W) f8 under a light of irradiance π, by Mitsuba's path integrator."""
        mi = self.mi
        scene = mi.load_dict(
            {
                "type": "scene",
                "mesh": self.mesh,
                "light": {
                    "type": "directional",
                    "direction": [float(-part) for part in light],
                    "irradiance": {"type": "rgb", "value": float(np.pi)},
                },
            }
        )
        path = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 99})
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed)
        out = [
            np.mean([path.sample(scene, sampler, ray)[0][1] for _ in range(samples)])
            for ray in self.sight(view)
        ]
        return np.array(out, np.float64).reshape(self.height.shape)

    def _ray(self, origin, way):
        ray = self.mi.Ray3f(self._point(origin), self._vector(way))
        return self.mi.RayDifferential3f(ray)

    def _vector(self, parts):
        return self.mi.Vector3f(*(float(part) for part in parts))

    def _point(self, parts):
        return self.mi.Point3f(*(float(part) for part in parts))


def _axes(parts):
    return np.moveaxis(parts, 2, 0)


def _write(path, points, normals, faces):
    names = ["x", "y", "z", "nx", "ny", "nz"]
    columns = np.concatenate([points, normals], axis=1)
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    table = np.empty(len(faces), [("count", "u1"), ("corner", "<i4", 3)])
    table["count"], table["corner"] = 3, faces
    with path.open("wb") as file:
        file.write(("\n".join(head) + "\n").encode())
        file.write(columns.astype("<f4").tobytes())
        file.write(table.tobytes())
