"""Write the schema of application files, which is made of their vocabulary: ``python tools/application_schema.py``."""

from __future__ import annotations

from pathlib import Path

from rtf.applications.xml import vocabulary

if __name__ == "__main__":
    Path(vocabulary.__file__).with_name("application.xsd").write_text(vocabulary.schema(), encoding="utf-8")
