"""From scans to one surface and its files: reconstruct, join, export, and what is said of them."""
