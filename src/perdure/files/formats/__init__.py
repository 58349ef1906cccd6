"""Other programs' formats, both ways: each file here is one, and says what of `Tracks` it holds."""

from perdure.files.formats.content import Content, Format, Reading, with_times
from perdure.files.formats.known import FORMATS, READ, WRITTEN, for_output, named, read, recognised
from perdure.files.formats.losses import Loss, lost
from perdure.files.formats.traits import ALL, Trait

__all__ = [
    "ALL",
    "FORMATS",
    "READ",
    "WRITTEN",
    "Content",
    "Format",
    "Loss",
    "Reading",
    "Trait",
    "for_output",
    "lost",
    "named",
    "read",
    "recognised",
    "with_times",
]
