"""JSON schemas of the documents that kinarm writes."""
