"""The paper: its claims, figures and tables, from the trainings of the reproduction."""
