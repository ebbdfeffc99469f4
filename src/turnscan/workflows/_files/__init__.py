"""Files: safe writing, reading, the history that a scan keeps and its settings."""
