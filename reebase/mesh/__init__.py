"""The mesh and what is done to it before any mathematics: read, write, check, repair."""
