"""x"""


def write_all(results, store, command):
    from kinarm.evaluation.reproduction.claims import assess

    return "\n".join(f"{c.name}: {c.verdict} {c.parts}" for c in assess(results))
