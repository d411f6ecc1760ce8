"""Hard cases of light: shadows, mirrors, fog."""
