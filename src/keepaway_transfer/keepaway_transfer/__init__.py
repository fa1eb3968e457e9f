"""From task to task, and was it worth it: mappings, rho, studies."""
