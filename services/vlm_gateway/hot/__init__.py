"""The pass-through's hot path: what a chat goes through between the client's socket and the model server's.

`door.py` is the whole way in one file; `server.py` is the connections to callers and `visit.py` one chat on them,
`scan.py` reads and rewrites a request without touching its pictures, `models.py` asks the models in turn,
`chat/upstream.py` one of them, `http1.py` is the connections to its server.
"""
