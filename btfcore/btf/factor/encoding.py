"""Codes of radiance in which distances are measured when a BTF is factorised (design §8)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.factor.elementary import code_rows, decode_rows
from btfcore.btf.sample import Encoding
from btfcore.errors import InvalidParameter
from btfcore.types import F4

NAMES = ("linear", "sqrt", "log", "logluma")
EPSILON = 0.01  # of the logarithms, unless an `Encoding` says otherwise; see docs/decisions/0014
_LEAST = 1e-12  # of an epsilon: far above subnormals, far below any radiance that matters
_MOST = 1e30


def checked(encoding: Encoding) -> Encoding:
    """Return `encoding`; raises `InvalidParameter` where name, epsilon or knee are of no use."""
    if encoding.name not in NAMES:
        raise InvalidParameter(f"encoding {encoding.name!r}, not one of {', '.join(NAMES)}")
    if not _LEAST <= encoding.epsilon <= _MOST:
        raise InvalidParameter(f"an epsilon of {encoding.epsilon}, not within {_LEAST} … {_MOST}")
    if encoding.knee is not None and not _LEAST <= encoding.knee <= _MOST:
        raise InvalidParameter(f"a knee of {encoding.knee}, not within {_LEAST} … {_MOST}")
    return encoding


def knobs(encoding: Encoding) -> tuple[int, np.float32, np.float32]:
    """Kind, epsilon and knee (0 for none) of an encoding, as the kernels take them."""
    return (
        NAMES.index(encoding.name),
        np.float32(encoding.epsilon),
        np.float32(encoding.knee or 0),
    )


def encode(radiance: NDArray[Any], encoding: Encoding) -> F4:
    """Code linear radiance (…, 3), finite and not negative; (…, 3) f4.

    Above the knee k (where there is one) x first becomes k (1 + log(x / k)), continued without
    a kink. Then "linear" is x; "sqrt" is √x; "log" is log(x + ε); "logluma" is log(Y + ε) with
    the shares (R + ε) / (Y + ε) and (B + ε) / (Y + ε) of red and blue, Y being the luminance.
    """
    rows = _rows(radiance)
    kind, epsilon, bend = knobs(checked(encoding))
    code_rows(rows[0], rows[1], rows[2], kind, epsilon, bend)
    return _pixels(rows, radiance.shape)


def decode(coded: NDArray[Any], encoding: Encoding) -> F4:
    """Radiance (…, 3) f4 of codes (…, 3): finite and not negative for any finite codes.

    Undoes `encode` to 2e-6 of the value: of x ("linear", "sqrt"), of x + ε ("log"), or of the
    pixel's greatest colour + ε ("logluma"), times 1 + log(x / k) above a knee k.
    """
    rows = _rows(coded)
    kind, epsilon, bend = knobs(checked(encoding))
    decode_rows(rows[0], rows[1], rows[2], kind, epsilon, bend)
    return _pixels(rows, coded.shape)


def _rows(pixels: NDArray[Any]) -> F4:
    if pixels.shape[-1:] != (3,):
        raise InvalidParameter(f"pixels of shape {pixels.shape}, where (…, 3) is needed")
    return np.array(pixels.reshape(-1, 3).T, np.float32, order="C")


def _pixels(rows: F4, shape: tuple[int, ...]) -> F4:
    return np.ascontiguousarray(rows.T).reshape(shape)
