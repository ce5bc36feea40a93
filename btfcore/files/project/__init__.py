"""The project file (.patina): all of a painted surface in one file that needs no other."""
