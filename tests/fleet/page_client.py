"""A person at the viewer's page or the hospital's, as far as its API goes."""
import http.client
import json
import os
import ssl
import subprocess


class Server:
    """A program that serves the page on an address of this machine, with `words` as its command."""

    def __init__(self, words, environment=None):
        self.process = subprocess.Popen([str(word) for word in words] + ["--listen", "127.0.0.1:0", "--json"], env=environment,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        told = ""
        for line in self.process.stdout:
            told += line
            if line.rstrip() == "}":
                break
        else:
            raise AssertionError(f"{words[0]} does not serve: {self.process.communicate()[1]}")
        told = json.loads(told)
        self.port, self.link = int(told["url"].split(":")[2].strip("/")), told["sign_in"].split("sign-in=")[1]

    def person(self):
        return Person(self.port)

    def processor_seconds(self):
        """Of the program and of what it started and waited for."""
        with open(f"/proc/{self.process.pid}/stat", encoding="utf-8") as file:
            fields = file.read().rpartition(")")[2].split()
        return sum(int(field) for field in fields[11:15]) / os.sysconf("SC_CLK_TCK")

    def end(self):
        self.process.terminate()
        self.process.communicate(timeout=60)

    def kill(self):
        self.process.kill()
        self.process.communicate(timeout=60)


class Person:
    def __init__(self, port):
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        self.connection = http.client.HTTPSConnection("127.0.0.1", port, context=context, timeout=120)
        self.cookie = ""

    def ask(self, path, body=None):
        """Status and body; a body that is sent makes it a POST."""
        headers = {"X-Kiroku-Request": "1", "Content-Type": "application/json", "Cookie": self.cookie}
        try:
            answer = self.answer("GET" if body is None else "POST", path, body, headers)
        except http.client.RemoteDisconnected:
            if body is not None:
                raise
            # A server closes a connection on which nothing was asked for a while, and a browser asks again.
            answer = self.answer("GET", path, None, headers)
        given = answer.headers.get_all("Set-Cookie", [])  # of the session, and of a device that is known from then on
        if given:
            self.cookie = "; ".join(each.split(";")[0] for each in given)
        return answer.status, answer.read()

    def answer(self, method, path, body, headers):
        self.connection.request(method, "/api/" + path, None if body is None else json.dumps(body), headers)
        return self.connection.getresponse()

    def tell(self, path, body=None):
        status, text = self.ask(path, body)
        if not 200 <= status < 300 or status == 202:
            raise AssertionError(f"{path} is answered with {status}: {text[:500]}")
        return text

    def read(self, path, body=None):
        return json.loads(self.tell(path, body))
