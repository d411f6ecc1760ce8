"""Hard cases of rays, cameras and numbers."""
