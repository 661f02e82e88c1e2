"""Problems, as TOML files."""
