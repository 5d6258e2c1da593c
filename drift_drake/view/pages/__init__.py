"""Reports as single HTML files: one look, one glossary, interactive charts, nothing loaded from elsewhere."""
