"""Readers of the Bonn binary BTF formats: DFMF, FMF, PVF and BDI."""
