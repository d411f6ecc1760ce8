"""What experiments that time programs share: launches, errors to ground truth, animations."""
