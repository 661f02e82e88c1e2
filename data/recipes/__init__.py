"""Recipes: settings of kinarm's learners by name, a file for each learner."""
