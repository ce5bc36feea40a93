"""Spherical harmonics and PCA over the light direction (Furukawa §2)."""
