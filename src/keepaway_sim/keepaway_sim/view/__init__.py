"""Pictures of a moment, and the page on which a match is watched."""
