"""Findings of the doctor, one line of JSON each, so that none is lost when a library crashes."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from ..errors import KarfError, error_from_code

OK, WARNING, ERROR = "ok", "warning", "error"
STATUSES = (OK, WARNING, ERROR)  # from good to bad
VERDICT = "engine"  # the name of the last finding, which summarizes the others


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Attributes:
        name: A stable word for programs: `torch`, `disk`, `geometry`; `engine` for the last finding.
        status: `ok`, `warning` (it works, with a limit) or `error` (the engine cannot work).
        sentence: The finding.
        remedy: What to do about it; optional packages have one even with the status `ok`.
        command: A terminal command that is the remedy, else empty.
        code: For an error, the `KarfError.code` of the resulting failure.
        seconds: Duration of a timed check.
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
        """The exit code of a process that ends with this finding."""
        return error_from_code(self.code, "").exit_code if self.status == ERROR else 0

    def to_line(self) -> str:
        """Return one line of JSON, without the line end."""
        return json.dumps(asdict(self))

    @property
    def lines(self) -> list[str]:
        """The sentence, and the remedy and command if any."""
        return [line for line in (self.sentence, self.remedy, self.command) if line]

    def to_text(self) -> str:
        """Return the finding for a terminal, with its remedy below it."""
        return f"{self.status:9}" + f"\n{'':9}".join(self.lines)

    @classmethod
    def from_line(cls, line: str) -> Finding:
        """Parse a line.

        Raises:
            ValueError: The line is not a finding.

        Examples:
            >>> Finding.from_line(Finding("disk", OK, "8 GB are free.").to_line()).sentence
            '8 GB are free.'
        """
        try:
            finding = cls(**json.loads(line))
        except TypeError as error:  # not an object, or other keys
            raise ValueError(str(error)) from error
        if finding.status not in STATUSES:
            raise ValueError(f"{finding.status!r} is not a status of a finding")
        return finding


def error_finding(name: str, error: KarfError, seconds: float | None = None) -> Finding:
    """Convert an error to a finding."""
    return Finding(name, ERROR, error.sentence, error.hint, code=error.code, seconds=seconds)
