"""Games in the worlds of another machine: messages, server, client, keys.

A client draws the seeds, checks actions and gives observations to the adapters; the server
simulates. Every message has a version, a header in msgpack and, at most, one block of raw arrays
whose size follows from the specs. Nothing is unpickled, on either side.
"""
