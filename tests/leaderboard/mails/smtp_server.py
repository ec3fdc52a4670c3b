"""A small SMTP server for tests: it answers as the recipient's name says, and keeps what it took."""

import socketserver
import threading
from collections.abc import Iterator
from contextlib import contextmanager

# What is answered at RCPT, or after the text, to a recipient whose name begins so.
AT_RCPT = {"gone": "550 5.1.1 No such user", "full": "452 4.2.2 Mailbox full", "busy": "421 4.3.2 Too busy"}
AT_DATA = {"spam": "554 5.7.1 Not wanted", "later": "451 4.7.1 Greylisted", "crash": ""}


class Server(socketserver.ThreadingTCPServer):
    """`taken` has recipients in order. `sender_answer` is for every sender.

    `recipient_answer` is for every recipient and `text_answer` for every text; empty: as its name says.
    """

    allow_reuse_address = daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Session)
        self.taken: list[str] = []
        self.asked: list[str] = []
        self.sender_answer = "250 ok"
        self.recipient_answer = self.text_answer = ""

    @property
    def port(self) -> int:
        return int(self.server_address[1])


class Session(socketserver.StreamRequestHandler):
    server: Server

    def handle(self) -> None:
        recipient = ""
        self.say("220 test")
        for raw in self.rfile:
            line = raw.decode().strip()
            verb = line[:4].upper()
            if verb == "RCPT":
                recipient = line.partition("<")[2].partition(">")[0]
                self.server.asked.append(recipient)
                answer = self.server.recipient_answer or answer_of(recipient, AT_RCPT)
                self.say(answer)
                if answer.startswith("421"):
                    return
            elif verb == "DATA":
                self.say("354 go on")
                self.read_text()
                answer = self.server.text_answer or answer_of(recipient, AT_DATA)
                if not answer:
                    return  # the connection breaks
                if answer.startswith("250"):
                    self.server.taken.append(recipient)
                self.say(answer)
            elif verb == "QUIT":
                self.say("221 bye")
                return
            else:
                self.say(self.server.sender_answer if verb == "MAIL" else "250 ok")

    def read_text(self) -> None:
        while self.rfile.readline().rstrip(b"\r\n") != b".":
            pass

    def say(self, line: str) -> None:
        self.wfile.write(f"{line}\r\n".encode())


def answer_of(recipient: str, answers: dict[str, str]) -> str:
    return next((text for name, text in answers.items() if recipient.startswith(name)), "250 ok")


@contextmanager
def running() -> Iterator[Server]:
    with Server() as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        thread.start()
        yield server
        server.shutdown()
        thread.join()
