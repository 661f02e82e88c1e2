"""Arms, as URDF files."""
