"""Policies on arms: backends, the loop and its watchdog, and the check of a contract."""
