"""Header texts, program name and time stamp of CAD files."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from importlib.metadata import version


@dataclass(frozen=True)
class FileHeader:
    """Texts for the header of a STEP or IGES file.

    Parameters
    ----------
    description, author, organisation, authorisation : str
        IGES has no place for an authorisation.
    """

    description: str = ""
    author: str = ""
    organisation: str = ""
    authorisation: str = ""


def program() -> str:
    """Return this program's name and version."""
    return f"ffdcli {version('ffdcli')}"


def stamp_time() -> time.struct_time:
    """Return the time for stamps: now, or the moment ``SOURCE_DATE_EPOCH`` names, in UTC."""
    return time.gmtime(int(os.environ.get("SOURCE_DATE_EPOCH") or time.time()))
