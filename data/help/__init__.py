"""What helps of commands end with, by the name of the command."""
