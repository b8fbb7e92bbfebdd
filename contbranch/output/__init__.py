"""Results as plots, HDF5 files, JSON documents and text; no physics."""
