"""Plants, as TOML files."""
