"""What the processor's own counters say, as the tools that read them print it."""
