"""Units as files spell them, what they measure, and their conversion to SI and ISO 8855."""
