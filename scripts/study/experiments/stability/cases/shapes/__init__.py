"""Hard cases of shapes and their distances."""
