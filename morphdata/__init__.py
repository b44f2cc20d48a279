"""All documents that enter or leave the system: fields, limits, checks and readers, for all packages."""
