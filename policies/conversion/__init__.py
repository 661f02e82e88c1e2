"""Networks of other libraries as policies of kinarm."""
