"""Work patches: growing, flattening and resampling pieces of a dense mesh (Zhou §III-B)."""
