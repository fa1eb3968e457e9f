"""State variables, tile coding, SMDP Sarsa(lambda), and weights on disk. Knows no simulator."""
