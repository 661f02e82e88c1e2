"""Studies: many trainings from one file, beside what could be reached."""
