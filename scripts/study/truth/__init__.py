"""The exact picture of a scene, and the exact arithmetic behind it."""
