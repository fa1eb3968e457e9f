"""A study's results for people: metrics, statistics, tables, figures."""
