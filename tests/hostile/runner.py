"""Runs the program as a person does, with limits, and keeps count of what goes wrong."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time

DONE = 0
USAGE, BAD_DATA, IO, DEVICE = 2, 3, 4, 5
REFUSED = {USAGE, BAD_DATA, IO, DEVICE}


class Outcome:
    """How a run ended. `status` is None where it had to be killed."""

    def __init__(self, status, seconds, busy_seconds, megabytes, err):
        self.status = status
        self.seconds = seconds
        self.busy_seconds = busy_seconds  # of all cores
        self.megabytes = megabytes
        self.err = err


def run(words, seconds=2.0, memory=2 << 30):
    """Runs `words` for at most `seconds`, ended by SIGTERM, in `memory` bytes of address space."""

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    with tempfile.TemporaryFile() as err:
        start = time.monotonic()
        process = subprocess.Popen([str(word) for word in words], stdin=subprocess.DEVNULL,
                                   stdout=subprocess.DEVNULL, stderr=err, preexec_fn=limit)
        timer = threading.Timer(seconds, process.kill)
        timer.start()
        _, wait_status, usage = os.wait4(process.pid, 0)
        timer.cancel()
        took = time.monotonic() - start
        process.returncode = os.waitstatus_to_exitcode(wait_status)
        status = None if process.returncode == -signal.SIGKILL else process.returncode
        err.seek(0)
        busy = usage.ru_utime + usage.ru_stime
        return Outcome(status, took, busy, usage.ru_maxrss / 1024,
                       err.read().decode(errors='replace'))


class Tally:
    """Counts runs, prints each that is wrong, and ends the program with 1 if one was."""

    def __init__(self):
        self.count = 0
        self.wrong = 0
        self.slowest = (0.0, '')
        self.largest = (0.0, '')

    def add(self, name, outcome, fault):
        self.count += 1
        self.slowest = max(self.slowest, (outcome.seconds, name))
        self.largest = max(self.largest, (outcome.megabytes, name))
        if fault:
            self.wrong += 1
            print(f'{name}: {fault} (status {outcome.status}, {outcome.seconds:.2f} s, '
                  f'{outcome.megabytes:.0f} MB): {outcome.err.strip()[:300]}', flush=True)

    def end(self):
        print(f'{self.count} runs, {self.wrong} wrong; slowest {self.slowest[0]:.2f} s '
              f'({self.slowest[1]}), largest {self.largest[0]:.0f} MB ({self.largest[1]})')
        sys.exit(1 if self.wrong else 0)
