"""What the doctor says: one finding after another, each a line of JSON, so that none is lost where a library crashes."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from ..errors import KarfError, error_from_code

OK, WARNING, ERROR = "ok", "warning", "error"
STATUSES = (OK, WARNING, ERROR)  # from good to bad
VERDICT = "engine"  # the name of the last finding, which sums the others up


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        name: What, as a stable word for programs: `torch`, `disk`, `geometry`; the last one's is `engine`.
        status: `ok`, `warning` (it works, with a limit) or `error` (the engine cannot work).
        sentence: What was found.
        remedy: What to do about it; may be there for what is only optional.
        command: What to type into a terminal where that is the remedy, else empty.
        code: Of an error, the class of error that it leads to (`KarfError.code`).
        seconds: How long it took, of what is timed.
    """

    name: str
    status: str
    sentence: str
    remedy: str = ""
    command: str = ""
    code: str = ""
    seconds: float | None = None

    @property
    def exit_code(self) -> int:
        """Of a process that ends with this finding."""
        return error_from_code(self.code, "").exit_code if self.status == ERROR else 0

    def to_line(self) -> str:
        """The finding as a line of JSON, without its end."""
        return json.dumps(asdict(self))

    @property
    def lines(self) -> list[str]:
        """The sentence, and the remedy and its command where there are any."""
        return [line for line in (self.sentence, self.remedy, self.command) if line]

    def to_text(self) -> str:
        """The finding for a terminal, with its remedy below it."""
        return f"{self.status:9}" + f"\n{'':9}".join(self.lines)

    @classmethod
    def from_line(cls, line: str) -> Finding:
        """The finding of a line.

        Raises:
            ValueError: The line is not a finding.

        Examples:
            >>> Finding.from_line(Finding("disk", OK, "8 GB are free.").to_line()).sentence
            '8 GB are free.'
        """
        try:
            finding = cls(**json.loads(line))
        except TypeError as error:  # no object, or other keys
            raise ValueError(str(error)) from error
        if finding.status not in STATUSES:
            raise ValueError(f"{finding.status!r} is not a status of a finding")
        return finding


def failing(name: str, error: KarfError, seconds: float | None = None) -> Finding:
    """An error as a finding."""
    return Finding(name, ERROR, error.sentence, error.hint, code=error.code, seconds=seconds)
