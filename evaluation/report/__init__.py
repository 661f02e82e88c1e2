"""The report of an evaluation: one HTML page that needs neither a server nor a network."""
