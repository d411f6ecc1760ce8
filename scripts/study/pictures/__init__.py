"""Pictures of phases and their metrics, and what draws figures."""
