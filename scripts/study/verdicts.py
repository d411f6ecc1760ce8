"""The words in which a paper's statement is judged here (study.claims, study.register, study.ablations)."""

HOLDS, PART, FAILS, OPEN = "holds here", "holds in part", "does not hold here", "not measured"
NEVER = "cannot be tested here"
FEW, UNSURE, WITHIN = "too few launches", "cannot be told apart here", "within the interval here"
