"""A connection that a test can break: what comes in at one port goes to another."""

import socket
import threading
from contextlib import closing, contextmanager, suppress


class Relay:
    """Relays connections to a port of this machine.

    Attributes:
        port: Where it listens.
    """

    def __init__(self, target):
        self._target = target
        self._open = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._start(self._accept)

    def _start(self, call, *arguments):
        threading.Thread(target=call, args=arguments, daemon=True).start()

    def _accept(self):
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._target))
                self._open += [near, far]
                self._start(self._copy, near, far)
                self._start(self._copy, far, near)

    def _copy(self, source, sink):
        with suppress(OSError):
            while content := source.recv(65536):
                sink.sendall(content)
        self._close(source, sink)

    def _close(self, *sockets):
        for one in sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()

    def break_all(self):
        """End all connections; new ones are accepted."""
        ended, self._open = self._open, []
        self._close(*ended)

    def close(self):
        """End all connections and accept no more."""
        self._close(self._listener)
        self.break_all()


@contextmanager
def relayed(address):
    """Relay to a server; yield the relay and the address to connect to."""
    with closing(Relay(int(address.rpartition(":")[2]))) as relay:
        yield relay, f"tcp://127.0.0.1:{relay.port}"
