"""Names and units as files write them: their words, what these measure, and conversion to SI and ISO 8855."""
