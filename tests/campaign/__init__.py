"""The campaign: damaged files, failing writes, kills, signals, and evidence at scale.

The tests of this folder run a small share of each; ``python -m tests.campaign.MODULE --out FILE``
runs the large one and records it.
"""
