"""Command lines and processes of the scripts."""
