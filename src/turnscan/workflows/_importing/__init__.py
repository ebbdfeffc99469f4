"""Pictures and range scans of others become a scan."""
