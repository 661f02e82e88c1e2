"""The paper's experiments: what is trained, how runs are kept, and what they say of its claims."""
