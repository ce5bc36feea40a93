"""Interpolation between the measured directions of a BTF."""
