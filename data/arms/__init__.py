"""Arms: arm files, and URDF files of kinarm's own."""
