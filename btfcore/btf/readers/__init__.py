"""Readers of image sets: Bonn file names, direction tables, RTI/PTM, PBR sets."""
