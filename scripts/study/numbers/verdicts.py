def held(claim: str, gain: Interval, failed: Iterable[str]) -> tuple[str, str]:
    """Verdict ("" for no claim) and reason. `claim`: a patch's `paper` line."""
    value = stated(claim)
    if value is None and not claim.startswith(("no gain", "not satisfying")):
        return "", ""
    if not gain.sufficient:
        return UNSURE, f"{gain.launches} launches are too few for an interval"
    if value is not None:
        return reached(gain, value)
    if claim.startswith("not satisfying") and list(failed):  # what the paper gave up: too wrong, or no faster
        return HOLDS, "too wrong a picture"
    if gain.high <= NO_GAIN:
        return HOLDS, f"no gain: all of the interval is below {NO_GAIN:g}"
    if gain.low > NO_GAIN:
        return FAILS, f"a gain: all of the interval is above {NO_GAIN:g}"
    return UNSURE, f"{NO_GAIN:g}, from where on it is a gain, is within the interval"
