"""A scan that is open in an editor: what it shows, its edits and their history."""
