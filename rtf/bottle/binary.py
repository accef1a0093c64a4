"""The binary form of bottles: what YARP's programs send each other.

A bottle is ``code n elements``, all integers little-endian. The code is LIST, with that of the elements added when all
have the same scalar type; then they stand without a code of their own. Inside a list of mixed types each element has
its code in front. A list inside is the same again; a property inside is its code and the bottle of its groups. Nothing
on the wire says which dialect is spoken, so it is a parameter: the two tag floats differently.

    decode, decode_from         bytes to a bottle: all of them, or as far as it goes
    encode, encode_blocks       a bottle to bytes: in one piece, or with large blobs in blocks of their own, not copied
    encode_element              one value with its code, for those who write lists that are no bottles
    extent, Scanner             where a bottle ends, without building it; the second while bytes still arrive
    possible_dialects           which dialects bytes can be
"""

from rtf.bottle.decoding import decode, decode_from
from rtf.bottle.encoding import LARGE_BLOB, encode, encode_blocks, encode_element
from rtf.bottle.extent import Scanner, extent, possible_dialects
from rtf.bottle.tags import DICT, LIST, MAX_ELEMENTS, TAGS, TruncatedBottleError

__all__ = [
    "DICT",
    "LARGE_BLOB",
    "LIST",
    "MAX_ELEMENTS",
    "TAGS",
    "Scanner",
    "TruncatedBottleError",
    "decode",
    "decode_from",
    "encode",
    "encode_blocks",
    "encode_element",
    "extent",
    "possible_dialects",
]
