"""What happened in a recorded match: a row an episode, passes, losses, actions, figures."""
