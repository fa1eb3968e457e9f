"""Keepaway's players: perceive, decide, learn."""
