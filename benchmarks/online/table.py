"""The table that the benchmarks of this folder fill in."""


class Table:
    """Prints line by line; `failed` counts the rows that miss their target."""

    def __init__(self) -> None:
        self.failed = 0

    def row(self, what: str, shown: str, target: str = "", good: bool | None = None) -> None:
        """Print one line; `good` is None for a row without a target."""
        verdict = "" if good is None else "ok" if good else "FAILS"
        self.failed += good is False
        print(f"{what:50s} {shown:74s} {target:30s} {verdict}", flush=True)
