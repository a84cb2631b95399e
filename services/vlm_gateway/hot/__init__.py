"""The pass-through's hot path: what a chat goes through between the client's socket and the model server's.

`frontend.py` is the whole way in one file; `server.py` is the connections to callers, `exchange.py` one chat on them,
`scan.py` reads and rewrites a request without touching its pictures, `request.py` checks it, `calls.py` asks the models
in turn. The package `upstream` is one model and the connections to its server.
"""
