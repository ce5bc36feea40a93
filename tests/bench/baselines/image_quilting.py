"""Image quilting of a plane as a program of its own: reads one PNG, writes another.

Efros & Freeman 2001, "Image quilting for texture synthesis and transfer", §2: overlapping square
blocks in scan order, each drawn from those whose overlap is within a tenth of the best, and cut
along the cheapest path. Matching and cutting are left to OpenCV (`matchTemplate`) or to
scikit-image (`route_through_array`) and its SciPy, so that it runs in any interpreter that has
one of them; nothing of Patina is imported.
"""

import argparse

import numpy as np

TOLERANCE = 0.1


def opencv_matcher(sample):
    """Return a function of (block, known): SSD of the known pixels at every place."""
    import cv2

    def costs(block, known):
        mask = np.repeat(known[..., None], 3, axis=2).astype(np.float32)
        return np.maximum(cv2.matchTemplate(sample, block, cv2.TM_SQDIFF, mask=mask), 0)

    return costs


def skimage_matcher(sample):
    """As `opencv_matcher`, by the transforms that scikit-image's `match_template` uses.

    That function itself knows no mask.
    """
    from scipy.signal import fftconvolve

    power = (sample**2).sum(axis=2)

    def costs(block, known):
        masked = (block * known[..., None])[::-1, ::-1]
        crossed = fftconvolve(sample, masked, mode="valid", axes=(0, 1)).sum(axis=2)
        here = fftconvolve(power, known[::-1, ::-1].astype(np.float32), mode="valid")
        return np.maximum(here - 2 * crossed + (masked**2).sum(), 0)

    return costs


def plain_path(cost):
    """Column of the cheapest path from the first row to the last, by dynamic programming."""
    total = cost.copy()
    for row in range(1, len(cost)):
        before = np.pad(total[row - 1], 1, constant_values=np.inf)
        total[row] += np.minimum(np.minimum(before[:-2], before[1:-1]), before[2:])
    path = [int(total[-1].argmin())]
    for row in range(len(cost) - 2, -1, -1):
        low = max(path[-1] - 1, 0)
        path.append(low + int(total[row, low : path[-1] + 2].argmin()))
    return np.array(path[::-1])


def skimage_path(cost):
    """As `plain_path`, by scikit-image's `route_through_array` with free ends."""
    from skimage.graph import route_through_array

    padded = np.pad(cost + 1e-9, ((1, 1), (0, 0)), constant_values=1e-12)
    places, _ = route_through_array(
        padded, (0, 0), (len(padded) - 1, 0), fully_connected=True, geometric=False
    )
    path = np.zeros(len(cost), int)
    for row, column in places:
        if 0 < row <= len(cost):
            path[row - 1] = column
    return path


def quilt(sample, size, block, overlap, costs, path, random):
    """Quilt a (size, size, 3) picture of `sample` (h, w, 3) f4."""
    step = block - overlap
    count = -(-(size - overlap) // step)
    out = np.zeros((count * step + overlap,) * 2 + (3,), np.float32)
    rows, columns = sample.shape[0] - block + 1, sample.shape[1] - block + 1
    for top in range(0, count * step, step):
        for left in range(0, count * step, step):
            here = out[top : top + block, left : left + block]
            known = np.zeros((block, block), bool)
            known[:overlap] |= top > 0
            known[:, :overlap] |= left > 0
            if known.any():
                cost = costs(here, known)
                near = np.flatnonzero(cost <= cost.min() * (1 + TOLERANCE) ** 2 + 1e-9)
                row, column = divmod(int(random.choice(near)), columns)
            else:
                row, column = int(random.integers(rows)), int(random.integers(columns))
            new = sample[row : row + block, column : column + block]
            apart = ((new - here) ** 2).sum(axis=2)
            take = np.ones((block, block), bool)
            if left > 0:
                cut = path(apart[:, :overlap].astype(np.float64))
                take[:, :overlap] &= np.arange(overlap) >= cut[:, None]
            if top > 0:
                cut = path(apart[:overlap].T.astype(np.float64))
                take[:overlap] &= (np.arange(overlap) >= cut[:, None]).T
            here[take] = new[take]
    return out[:size, :size]


def main():
    """Read the arguments, the sample; write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", choices=("opencv", "skimage"))
    parser.add_argument("sample", nargs="?")
    parser.add_argument("output", nargs="?")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--block", type=int, default=36)
    parser.add_argument("--overlap", type=int, default=9)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", action="store_true", help="only load what a run needs")
    given = parser.parse_args()
    if given.library == "opencv":
        import cv2

        cv2.setNumThreads(1)

        def read(path):
            return cv2.imread(path, cv2.IMREAD_COLOR)

        def write(path, picture):
            cv2.imwrite(path, picture)

        matcher, path = opencv_matcher, plain_path
    else:
        import scipy.signal  # noqa: F401  (loading is part of the start)
        from skimage import graph, io  # noqa: F401

        def read(path):
            return io.imread(path)[..., :3]

        def write(path, picture):
            io.imsave(path, picture, check_contrast=False)

        matcher, path = skimage_matcher, skimage_path
    if given.start:
        return
    sample = read(given.sample).astype(np.float32)
    random = np.random.default_rng(given.seed)
    out = quilt(sample, given.size, given.block, given.overlap, matcher(sample), path, random)
    write(given.output, np.round(out).astype(np.uint8))


if __name__ == "__main__":
    main()
