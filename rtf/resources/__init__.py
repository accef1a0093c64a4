"""Configuration files and their search paths: YARP's property file format, command lines and ResourceFinder.

:func:`read_property_file` parses a file to a :class:`~rtf.bottle.Property`, :class:`ResourceFinder` finds it and lists
the searched places, :func:`find_parameters` does both for a test. This package opens no ports.
"""

from rtf.resources.arguments import parse_arguments, split_arguments
from rtf.resources.errors import (
    ResourceError,
    ResourceIncludeError,
    ResourceLimitError,
    ResourceNotFoundError,
    ResourceReadError,
    ResourceSyntaxError,
)
from rtf.resources.finder import (
    Place,
    PlaceStatus,
    Policy,
    ResourceFinder,
    Search,
    parse_property_text,
    read_property_directory,
    read_property_file,
)
from rtf.resources.lines import Diagnostic, DiagnosticKind
from rtf.resources.parameters import DEFAULT_CONTEXT, Parameters, find_parameters
from rtf.resources.property_file import MAX_FILES, MAX_INCLUDE_DEPTH, MAX_SIZE, PropertyFile

__all__ = [
    "DEFAULT_CONTEXT",
    "MAX_FILES",
    "MAX_INCLUDE_DEPTH",
    "MAX_SIZE",
    "Diagnostic",
    "DiagnosticKind",
    "Parameters",
    "Place",
    "PlaceStatus",
    "Policy",
    "PropertyFile",
    "ResourceError",
    "ResourceFinder",
    "ResourceIncludeError",
    "ResourceLimitError",
    "ResourceNotFoundError",
    "ResourceReadError",
    "ResourceSyntaxError",
    "Search",
    "find_parameters",
    "parse_arguments",
    "parse_property_text",
    "read_property_directory",
    "read_property_file",
    "split_arguments",
]
