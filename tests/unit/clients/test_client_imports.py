"""The client is light: it loads neither a framework nor what it does not use."""

from __future__ import annotations

import subprocess
import sys


def test_importing_the_client_loads_no_framework() -> None:
    script = (
        "import sys, fluentboard_client\n"
        "heavy = {'fastapi', 'rdflib', 'pyoxigraph', 'numpy', 'open3d', 'websockets', 'typer'}\n"
        "print(*sorted(heavy & sys.modules.keys()))"
    )
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (shown.stdout.strip(), shown.stderr) == ("", "")
