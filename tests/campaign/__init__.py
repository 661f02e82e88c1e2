"""The campaign: damaged files, failing writes, kills and signals.

The tests of this folder run a small share of each; ``python -m tests.campaign.MODULE --out FILE``
runs the large one and records it.
"""
