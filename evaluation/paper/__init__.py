"""The paper: its claims, figures and tables, reproduced."""
