"""Sets of directions, and paths over the hemisphere, that the laws are tested on."""

import numpy as np

from btfcore.btf.directions import from_angles, layout, rings


def scattered(count, seed, limit=np.pi / 2):
    """Directions evenly at random up to the polar angle `limit`."""
    rng = np.random.default_rng(seed)
    theta = np.arccos(rng.uniform(np.cos(limit), 1, count))
    return from_angles(theta, rng.uniform(0, 2 * np.pi, count))


GRIDS = {
    "12x8": layout("12x8x1x1").views,
    "12x5": layout("12x5x1x1").views,
    "ubo81": layout("ubo81").views,
    "ubo151": layout("ubo151").views,
    "one ring": rings([(45, 8, 10)]),
    "odd ring": rings([(30, 5, 0), (60, 7, 3)]),
    "pole and ring": rings([(0, 1, 0), (60, 3, 0)]),
    "pole": np.array([[0.0, 0.0, 1.0]]),
    "shuffled": np.random.default_rng(3).permutation(layout("ubo81").views),
    "horizon": rings([(0, 1, 0), (90, 6, 0)]),
}
GRIDS["whole degrees"] = from_angles(  # as file names round them
    np.radians(np.repeat([0, 20, 50], [1, 12, 16])),
    np.radians(np.round(np.concatenate([[0], 7.5 + 30 * np.arange(12), 22.5 * np.arange(16)]))),
)
SETS = {
    **GRIDS,
    "two": from_angles([0.2, 0.9], [0.0, 2.0]),
    "meridian": from_angles(np.radians([60, 30, 0, 30, 60]), np.array([0, 0, 0, 1, 1]) * np.pi),
    "slanted line": from_angles(np.radians([70, 20, 40]), [1.0, 1.0, 1.0]),
    "half a ring": from_angles(np.full(5, 0.7), np.linspace(0, 2, 5)),
    "few": scattered(5, 1),
    "many": scattered(200, 2),
    "cluster": from_angles(
        0.6 + 1e-3 * np.random.default_rng(4).normal(size=30),
        1e-3 * np.random.default_rng(5).normal(size=30),
    ),
    "off the pole": scattered(40, 6, 0.5) @ [[0.8, 0, -0.6], [0, 1, 0], [0.6, 0, 0.8]],
}
SETS["off the pole"] = SETS["off the pole"][SETS["off the pole"][:, 2] > 0.05]
METHODS = ("grid", "barycentric", "nearest4", "nearest")
CASES = [(name, method) for name in SETS for method in METHODS if method != "grid" or name in GRIDS]
CONTINUOUS = [(name, method) for name, method in CASES if not method.startswith("nearest")]


def dense(mixture, count):
    """Weights (n, count) of a mixture (index, weight), one column a direction."""
    index, weight = mixture
    out = np.zeros((len(index), count))
    np.add.at(out, (np.arange(len(index))[:, None], index), weight)
    return out


def paths(steps):
    """Paths of vectors (steps, 3) above the horizon, by name."""
    line = np.linspace(0, 1, steps)
    turn = 2 * np.pi * line
    rise = np.radians(89) * np.sin(np.pi * line)
    return {
        "around at 50 degrees, over the wrap": from_angles(np.radians(50), turn - 3),
        "around close to the pole": from_angles(1e-3, turn),
        "around the border": from_angles(np.radians(75), turn),
        "around beyond the border": from_angles(np.radians(88), turn),
        "over the pole": from_angles(np.radians(80) * (1 - 2 * line), np.full(steps, 0.3)),
        "past the pole": from_angles(np.hypot(0.01, 2 * line - 1), turn / 2),
        "out and back": from_angles(rise, 0.7 + 0.2 * line),
    }
