"""What reports are made of: documents, HTML pages, pictures and the colours that mean something."""
