"""The command line `race`: one file for each family of commands."""
