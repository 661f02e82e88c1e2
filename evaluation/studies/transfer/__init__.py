"""Transfer: what policies for one task are worth for other tasks and for another arm."""
