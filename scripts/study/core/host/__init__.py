"""The machine and the tools at hand: CPUs, quotas, the checkout, children that end in time."""
