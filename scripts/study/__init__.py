"""What the scripts share: registry, build, run, store, statistics, machine, images."""
