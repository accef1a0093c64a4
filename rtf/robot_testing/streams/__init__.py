"""Message streams: recording ports, decoding sensor messages, statistics of rates and losses."""
