"""A proxy before an S3 server that does what networks and servers do at their worst: errors, slow answers, torn connections, clocks apart, restarts."""

import datetime
import http.client
import random
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

# How far a client's clock may be off before a store refuses, s: as S3 has it.
SKEW_S = 900


class Proxy:
    """Between workers and the server at a port. `share` of all requests meet the fault; `seed` decides which."""

    def __init__(self, server_port, fault=None, share=0.0, seed=1, port=0):
        self.server_port = server_port
        # What the server was told to write and said it had, in order; and requests that it is at.
        self.written, self.at_work, self.changed = [], 0, threading.Condition()
        self.fault, self.share = fault, share
        self.draws, self.lock = random.Random(seed), threading.Lock()
        self.requests, self.hits = 0, 0
        self.start(port)

    def start(self, port):
        proxy = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def log_message(self, *_):
                pass

            def handle_one(self):
                proxy.answer(self)

            do_GET = do_HEAD = do_PUT = do_DELETE = do_POST = handle_one

        class Server(ThreadingHTTPServer):
            daemon_threads = True
            allow_reuse_address = True

            def handle_error(self, *_):
                pass

        self.httpd = Server(("127.0.0.1", port), Handler)
        self.port = self.httpd.server_address[1]
        self.connections = set()
        threading.Thread(target=self.httpd.serve_forever, daemon=True).start()

    def restart(self, server):
        """The server is killed amid its requests, with every connection, and a new one comes at the same port, which has what the old one said that it had written."""
        self.httpd.shutdown()
        self.httpd.server_close()
        server.kill()
        for connection in list(self.connections):
            tear(connection)
        with self.changed:
            self.changed.wait_for(lambda: self.at_work == 0)
        server.start()
        for method, path, body, headers in self.written:
            self.forward(method, path, body, headers)
        self.start(self.port)

    def forward(self, method, path, body, headers):
        """What the server answers, and its content."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server_port, timeout=60)
        try:
            connection.request(method, path, body, headers)
            answer = connection.getresponse()
            return answer, answer.read()
        finally:
            connection.close()

    def stop(self):
        self.httpd.shutdown()
        self.httpd.server_close()

    def meets_fault(self):
        with self.lock:
            self.requests += 1
            hit = self.fault is not None and self.draws.random() < self.share
            self.hits += hit
            return hit, self.draws.random()

    def answer(self, handler):
        self.connections.add(handler.connection)
        body = handler.rfile.read(int(handler.headers.get("Content-Length") or 0))
        hit, draw = self.meets_fault()
        if self.fault == "clock" and self.is_apart(handler):
            self.hits += 1
            return refuse(handler, 403, "RequestTimeTooSkewed", "The difference between the request time and the current time is too large.")
        if hit and self.fault == "errors":
            if draw < 0.5:
                return refuse(handler, 500, "InternalError", "We encountered an internal error. Please try again.")
            return refuse(handler, 503, "SlowDown", "Please reduce your request rate.")
        if hit and self.fault == "torn" and draw < 0.33:
            # Before the server has seen the request.
            return tear(handler.connection)
        request = (handler.command, handler.path, body, {name: value for name, value in handler.headers.items() if name.lower() != "connection"})
        with self.changed:
            self.at_work += 1
        try:
            answer, content = self.forward(*request)
            if handler.command in ("PUT", "DELETE", "POST") and answer.status < 300:
                # Before anybody hears of it.
                self.written.append(request)
        finally:
            with self.changed:
                self.at_work -= 1
                self.changed.notify_all()
        if hit and self.fault == "torn" and draw < 0.67:
            # The server has done what was asked, and nobody is told.
            return tear(handler.connection)
        handler.send_response(answer.status)
        for name, value in answer.getheaders():
            if name.lower() not in ("connection", "transfer-encoding", "content-length", "date", "server"):
                handler.send_header(name, value)
        # The answer to HEAD has the length of what it does not send.
        handler.send_header("Content-Length", answer.getheader("Content-Length") if handler.command == "HEAD" and answer.getheader("Content-Length") else str(len(content)))
        handler.end_headers()
        if handler.command == "HEAD":
            return None
        if hit and self.fault == "torn":
            handler.wfile.write(content[: len(content) // 2])
            handler.wfile.flush()
            return tear(handler.connection)
        if hit and self.fault == "slow":
            for at in range(0, len(content), max(1, len(content) // 20)):
                handler.wfile.write(content[at : at + max(1, len(content) // 20)])
                handler.wfile.flush()
                time.sleep(0.1)
            return None
        handler.wfile.write(content)
        return None

    def is_apart(self, handler):
        stamp = handler.headers.get("x-amz-date")
        if not stamp:
            return False
        told = datetime.datetime.strptime(stamp, "%Y%m%dT%H%M%SZ").replace(tzinfo=datetime.timezone.utc)
        return abs((told - datetime.datetime.now(datetime.timezone.utc)).total_seconds()) > SKEW_S


def refuse(handler, status, code, message):
    body = f'<?xml version="1.0" encoding="UTF-8"?><Error><Code>{code}</Code><Message>{message}</Message></Error>'.encode()
    handler.send_response(status)
    handler.send_header("Content-Type", "application/xml")
    handler.send_header("Content-Length", str(len(body)))
    handler.end_headers()
    if handler.command != "HEAD":
        handler.wfile.write(body)


def tear(connection):
    """Ends a connection at once, without a word."""
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass
