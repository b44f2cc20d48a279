"""Processing common to all requests: limits, parsing, problem documents."""
