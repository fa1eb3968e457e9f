"""Studies as data, run, stopped and resumed; the paper's are the .toml files beside."""
