"""Effects of the catalogue as candidates: scores, causes, refits, verdicts."""
