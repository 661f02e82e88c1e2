"""What ``kinarm-bench`` measures: one concept a module, put together by `benchmark`."""
