"""The campaign: damaged files, odd arguments and failing machines, thousands of each.

Every module has a small size, which the tests of this folder run, and a large one, which
``python -m tests.campaign.MODULE`` runs and records.
"""
