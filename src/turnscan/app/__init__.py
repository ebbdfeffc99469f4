"""The server behind the browser workshop: one more door to the same rooms as the command line."""
