"""Claims made to order, and those of the register."""

from __future__ import annotations

import msgspec

from study.claims import claim
from study.claims.claim import Claim

ANY = Claim("P1", "", "scene0", "baseline", "baseline", "×", "", 1, "", "a note", "")


def claimed(**about: object) -> Claim:
    return msgspec.structs.replace(ANY, **about)


def of(quantity: str) -> Claim:
    """The register's only one of that kind."""
    (found,) = [one for one in claim.read() if one.quantity == quantity]
    return found
