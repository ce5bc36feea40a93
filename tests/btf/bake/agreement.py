"""Measures how far baked samples agree with Mitsuba; for the tests and the benchmark."""

from dataclasses import dataclass

import numpy as np

from btfcore.btf.bake.relief import relief
from btfcore.btf.bake.stack import BakedStack
from tests.btf.bake import fields
from tests.btf.bake.fields import direction
from tests.btf.bake.mitsuba_door import Scene

# no azimuth along a mesh line: Mitsuba's rays slip between triangles there
VIEWS = np.array([direction(5, 17), direction(45, 30), direction(75, 200)])
LIGHTS = np.array([direction(20, 10), direction(50, 100), direction(75, 250), direction(75, 2)])


@dataclass(frozen=True)
class Agreement:
    """One view and light: mean distance of seen points in texels, share of texels whose shadow
    agrees, ratio of the mean radiances, share of texels in shadow."""

    view: int
    light: int
    distance: float
    shadows: float
    mean: float
    dark: float


def agreement(height, depth, *, fine, views=VIEWS, lights=LIGHTS):
    """Compare a tiling height field (h, w) in 0–1 under all pairs; albedo 0.5, diffuse."""
    scene = Scene(height * depth, fine=fine)
    made = relief(fields.plain(height, depth=depth), reflectance=0)
    rows, columns = height.shape
    out = []
    for v, view in enumerate(views):
        points, hidden, cosine = scene.seen(view, lights)
        stack = BakedStack(made, views, lights)
        images = stack.read(v * len(lights) + np.arange(len(lights)))[..., 1]
        seen = stack._look(v, 0, rows * columns)
        off = [
            (seen.x - points[..., 0].ravel() + columns / 2) % columns - columns / 2,
            (seen.y + points[..., 1].ravel() + rows / 2) % rows - rows / 2,
        ]
        for k in range(len(lights)):
            wanted = 0.5 * np.maximum(cosine[k], 0) * ~hidden[k]
            mine = images[k] == 0
            theirs = hidden[k] | (cosine[k] <= 0)
            out.append(
                Agreement(
                    view=v,
                    light=k,
                    distance=float(np.hypot(*off).mean()),
                    shadows=float((mine == theirs).mean()),
                    mean=float(images[k].mean() / wanted.mean()),
                    dark=float(theirs.mean()),
                )
            )
    return out


def bounce_agreement(height, depth, *, albedo, samples):
    """Ratios of bounced light and of all light to Mitsuba's for two views and lights."""
    views = VIEWS[:2]
    lights = np.array([direction(20, 10), direction(65, 100)])
    colour = {"type": "rgb", "value": albedo}
    scene = Scene(height * depth, fine=2, bsdf={"type": "diffuse", "reflectance": colour})
    made = relief(fields.plain(height, depth=depth, albedo=albedo), reflectance=0)
    direct = BakedStack(made, views, lights).read(np.arange(4))[..., 1]
    both = BakedStack(made, views, lights, bounce=True).read(np.arange(4))[..., 1]
    out = []
    for number in range(4):
        pair = views[number // 2], lights[number % 2]
        one = scene.radiance(*pair)
        two = scene.radiance(*pair, depth=3, samples=samples)
        bounced = (both[number] - direct[number]).mean() / (two - one).mean()
        out.append((float(bounced), float(both[number].mean() / two.mean())))
    return out
