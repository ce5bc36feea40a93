"""Factorises BTFs into geometry maps and eigen point-appearance functions (Zhou §III-B)."""
