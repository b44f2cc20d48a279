"""The report: the stages' results as one page of tables and figures."""
