"""Many scans at once: the recipe, its tasks, their processes, the table of results."""
