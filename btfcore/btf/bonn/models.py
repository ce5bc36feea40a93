"""The colour models in which Bonn's factorised files keep their values."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from btfcore.types import F4, F8, Frozen

EPSILON = 1e-5
RGB, YUV, LAB, PCA, YCOCG, YLOG_UV, LOG_YUV, YLOG_RATIOS, LOG_RGB = 0, 1, 2, 3, 4, 9, 10, 11, 12
NAMES = {
    RGB: "RGB",
    YUV: "YUV",
    LAB: "Lab",
    PCA: "PCA",
    YCOCG: "YCoCg",
    YLOG_UV: "log Y, U, V",
    LOG_YUV: "log Y, log U, log V",
    YLOG_RATIOS: "log Y, U/Y, V/Y",
    LOG_RGB: "log RGB",
}
SPECTRAL = {5: "spectral", 6: "linear spectral"}
GREY_MODELS = (RGB, LOG_RGB)  # that have no use for three channels

YUV_TO_RGB = np.array([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]])
_YCOCG_TO_RGB = np.array([[1.0, 1, -1], [1, 0, 1], [1, -1, -1]])
# CIE Lab under D50; Bradford's adaptation of D50 to D65 and the Rec. 709 primaries in one.
_D50 = np.array([0.96422, 1.0, 0.82521])
_D50_TO_RGB = np.array(
    [
        [3.1338561, -1.6168667, -0.4906146],
        [-0.9787684, 1.9161415, 0.0334540],
        [0.0719453, -0.2289914, 1.4052427],
    ]
)


@dataclass(frozen=True, eq=False)
class ColourModel(Frozen):
    """A model's number; mean (3,) and transform (3, 3) f8 of PCA.

    reduced : what the model yields is the logarithm of the radiance (plus 1e-5).
    """

    number: int = RGB
    mean: F8 = field(default_factory=lambda: np.zeros(3))
    transform: F8 = field(default_factory=lambda: np.eye(3))
    reduced: bool = False


def decode(model: ColourModel, values: F4) -> F4:
    """Linear radiance (…, 3) f4 of coded values (…, 3) f4; may be negative, infinite or NaN.

    Values (…, 1) are grey and stay so. Logarithms are natural, of the value plus 1e-5; a
    negative chroma keeps its sign outside the logarithm.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        radiance = _without_model(model, values)
        if model.reduced:
            radiance = np.exp(radiance) - np.float32(EPSILON)
    return radiance


def _without_model(model: ColourModel, values: F4) -> F4:
    number = model.number
    if number == RGB:
        return values
    if number == LOG_RGB:
        return np.exp(values) - np.float32(EPSILON)
    if number == PCA:
        return values @ model.transform.astype(np.float32) + model.mean.astype(np.float32)
    if number == YCOCG:
        return values @ _YCOCG_TO_RGB.T.astype(np.float32)
    if number == LAB:
        return _lab_to_rgb(values)
    coded = values
    if number != YUV:
        coded = values.copy()
        raised = np.exp(values[..., :1])
        coded[..., :1] = raised - np.float32(EPSILON)
        if number == YLOG_RATIOS:
            coded[..., 1:] *= raised
        elif number == LOG_YUV:
            chroma = values[..., 1:]
            coded[..., 1:] = np.sign(chroma) * np.exp(np.abs(chroma)) * np.float32(EPSILON)
    return coded @ YUV_TO_RGB.T.astype(np.float32)


def encode(number: int, radiance: F4) -> F4:
    """Coded values (…, 3) f4 of radiance (…, 3) f4 ≥ 0 in model RGB or YLOG_RATIOS."""
    if number == RGB:
        return radiance
    yuv = radiance @ np.linalg.inv(YUV_TO_RGB).T.astype(np.float32)
    raised = np.maximum(yuv[..., :1], 0) + np.float32(EPSILON)
    return np.concatenate([np.log(raised), yuv[..., 1:] / raised], axis=-1)


def _lab_to_rgb(lab: F4) -> F4:
    # Bonn's reader ends in the coded sRGB that MATLAB makes of Lab; we stop at linear values.
    lightness = (lab[..., 0].astype(np.float64) + 16) / 116
    bent = np.stack([lightness + lab[..., 1] / 500, lightness, lightness - lab[..., 2] / 200], -1)
    ratio = np.where(bent > 6 / 29, bent**3, 3 * (6 / 29) ** 2 * (bent - 4 / 29))
    return ((ratio * _D50) @ _D50_TO_RGB.T).astype(np.float32)
