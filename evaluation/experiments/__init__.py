"""Studies: many trainings from one file, each of them judged beside what could be reached."""
