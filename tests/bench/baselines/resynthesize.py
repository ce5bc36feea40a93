"""Harrison's resynthesizer (PyPI `resynthesizer`) as a program: reads one PNG, writes another.

The library fills a masked part of a picture from the rest of it, so the sample stands beside the
wanted square. What lies below the sample must be filled as well: a fifth more than is kept.
"""

import argparse

from PIL import Image


def main():
    """Read the arguments, the sample; write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sample", nargs="?")
    parser.add_argument("output", nargs="?")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--start", action="store_true", help="only load what a run needs")
    given = parser.parse_args()
    from resynthesizer import getDefaultParams, resynthesize

    if given.start:
        return
    with Image.open(given.sample) as picture:
        sample = picture.convert("RGB")
    canvas = Image.new("RGB", (given.size + sample.width, max(given.size, sample.height)))
    mask = Image.new("L", canvas.size, 255)
    corner = (given.size, 0)
    canvas.paste(sample, corner)
    mask.paste(0, (*corner, given.size + sample.width, sample.height))
    knobs = getDefaultParams()
    knobs.isMakeSeamlesslyTileableHorizontally = knobs.isMakeSeamlesslyTileableVertically = 0
    knobs.matchContextType = 0  # nothing around the square is to be continued
    resynthesize(canvas, mask, knobs).crop((0, 0, given.size, given.size)).save(given.output)


if __name__ == "__main__":
    main()
