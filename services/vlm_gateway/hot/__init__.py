"""The pass-through's hot path: what a chat goes through between the client's socket and the model server's.

`door.py` is the whole way in one file; `scan.py` reads and rewrites a request without touching its pictures,
`target.py` is one model's server with its retries and limits, `http1.py` the connections to it.
"""
