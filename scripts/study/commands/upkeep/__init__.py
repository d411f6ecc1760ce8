"""Commands for who keeps the project: pages and lessons made anew, runs published, the artifact."""
