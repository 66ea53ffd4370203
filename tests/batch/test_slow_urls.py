"""Web servers that are silent, or never stop sending, are given up."""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from ffdcli.batch import places
from ffdcli.errors import FileError

pytest.importorskip("aiohttp")


class Endless(BaseHTTPRequestHandler):
    """Says nothing of the length, and sends until the other side hangs up; or is silent."""

    released = threading.Event()

    def do_HEAD(self):
        self.send_response(200)
        self.end_headers()

    def do_GET(self):
        if "silent" in self.path:
            self.released.wait(20)
            return
        self.do_HEAD()
        try:
            while not self.released.is_set():
                self.wfile.write(bytes(1 << 16))
        except OSError:
            pass

    def log_message(self, *_):
        pass


@pytest.fixture
def server():
    Endless.released.clear()
    with ThreadingHTTPServer(("127.0.0.1", 0), Endless) as made:
        threading.Thread(target=made.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{made.server_port}"
        Endless.released.set()
        made.shutdown()


def test_endless_downloads_are_refused(server, tmp_path, monkeypatch):
    monkeypatch.setattr(places, "MOST_BYTES", 1 << 22)
    with pytest.raises(FileError, match="more than"):
        places.fetch(".", f"{server}/a.obj", str(tmp_path))
    with pytest.raises(FileError, match="more than"):
        places.digest(".", f"{server}/a.obj")


def test_silent_servers_are_given_up(server, tmp_path, monkeypatch):
    monkeypatch.setattr(places, "SILENCE", 0.3)
    with pytest.raises(FileError) as caught:
        places.fetch(".", f"{server}/silent.obj", str(tmp_path))
    assert caught.value.file == f"{server}/silent.obj"
