"""The clients of docs/guide/streams.md as they stand there, against the program: the Python text, or the C# text with Mono.

Run by `cargo xtask test clients` with host-sim's path, and by `cargo xtask nightly csharp` with `csharp` after it. Everything is
on loopback. Only the port is another one.
"""

import pathlib
import re
import subprocess
import sys
import tempfile

PAGE = pathlib.Path(__file__).parents[2] / "docs/guide/streams.md"
USUAL = "127.0.0.1:8711"
LINES = 20
SAID = re.compile(r"^ *-?\d+[.,]\d\d mm +-?\d+[.,]\d\d N +\w+$")


def text(language):
    """The only block of this language, with a place for the port."""
    blocks = re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 1, f"{len(blocks)} blocks of {language} in {PAGE}"
    assert USUAL in blocks[0], f"the {language} text does not connect to {USUAL}"
    return blocks[0]


def check(name, command):
    """Its first lines are poses of a needle that moves."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as client:
        lines = [client.stdout.readline().rstrip("\n") for _ in range(LINES)]
        client.kill()
        complaint = client.stderr.read()
    wrong = [line for line in lines if not SAID.match(line)]
    assert not wrong, f"{name} said {wrong[0]!r}: {complaint}"
    print(f"documented client in {name}: pass ({lines[-1].strip()})")


def main(program, language="python"):
    command = [program, "run", "--headless", "--stream", "websocket=127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child, tempfile.TemporaryDirectory() as folder:
        try:
            found = re.match(r"websocket stream at ([\d.:]+)$", child.stdout.readline())
            place = pathlib.Path(folder)
            client = place / f"client.{language}"
            client.write_text(text(language).replace(USUAL, found[1]), encoding="utf-8")
            if language == "python":
                # Each line at once, and not when a block of them is full.
                check("Python", [sys.executable, "-u", client])
                return
            built = place / "client.exe"
            compiler = ["mcs", "-warnaserror-", "-nowarn:649", "-r:System.Runtime.Serialization.dll", f"-out:{built}", client]
            subprocess.run(compiler, check=True)
            check("C#", ["mono", built])
        finally:
            child.terminate()


if __name__ == "__main__":
    main(*sys.argv[1:])
