"""`drift-drake demo` and `drift-drake init`: what a new user begins with."""
