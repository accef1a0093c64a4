"""The errors of campaigns."""

from __future__ import annotations

from rtf.errors import RtfError


class CampaignError(RtfError, ValueError):
    """A campaign that cannot be read or run. The message names the file, the line where it is known, and what to do."""
