"""What is replayed: finding and choosing trials, recording entrants, following them live."""
