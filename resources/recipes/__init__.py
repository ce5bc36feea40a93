"""Recipes of the shipped samples: procedural PBR sets, made for Patina, CC0.

Every recipe is a function of a `Canvas`; the same seed gives the same maps. All of it is
periodic, so that every sample tiles, and all lengths are in texels of the finished sample.
"""
