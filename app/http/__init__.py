"""What every request passes through: limits, parsing, problem documents."""
