#!/usr/bin/env python3
"""Puts pipes, devices, sockets and the like in place of every path of every command of `sateen`.

    special_files.py PROGRAM [--all]

The list comes from the program's own --help: each option and positional that takes text, whether it
is a path or not. Each run must end by itself within 2 s, refused with words and status 2 to 5.
Without --all: a pipe, an endless device and a loop of links alone, and not for benchmarks.
"""

import os
import pathlib
import re
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time

import runner

SECONDS = 2.0
# A busy machine: a run that hangs is still told from one that is slow.
CLOCK_SECONDS = 20.0

# Free text, which is right whatever it says.
FREE = {'--operator', '--notes', '--title', '--name'}

# Files that every command makes anew: a pipe there is replaced, never written to.
SCENE = '''{"schema": "sateen.scene/1", "rig": "rig.json",
"surface": {"shape": "plane"}, "materials": {"surface": {"albedo": [0.5, 0.5, 0.5]}}}'''
RIG = '''{"schema": "sateen.rig/1",
"camera": {"model": "simulated", "size_px": [64, 48], "k": [80, 80, 31.5, 23.5],
  "distortion": [0, 0, 0, 0, 0],
  "table_from_camera": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 400, 0, 0, 0, 1]},
"lights": [%s]}''' % ', '.join(
    '{"name": "led-%d", "channel": %d, "model": "near", "position_mm": [%d, %d, 400], '
    '"flux_rgb": [160000, 160000, 160000]}' % (k, k, x, y)
    for k, (x, y) in enumerate([(200, 0), (0, 200), (-200, 0), (0, -200), (150, 150)]))


def command_lines(w):
    """A command line of each command, with values that are right or fail soon by themselves."""
    session, rig, out = w / 'session', w / 'rig.json', w / 'out'
    return {
        'solve': [session, '-o', out],
        'simulate': [w / 'scene.json', '-o', out],
        'calibrate lens': [session, '--board', 'chessboard:9x6:24mm', '-o', out / 'rig.json'],
        'calibrate pose': [session, '--board', 'chessboard:9x6:24mm', '--rig', rig, '-o',
                           out / 'rig.json'],
        'calibrate response': [session, '--rig', rig, '-o', out / 'rig.json'],
        'calibrate lights': ['--sheet', session, '--rig', rig, '-o', out / 'rig.json'],
        'calibrate check': ['--sheet', session, '--rig', rig],
        'calibrate spheres': [session, '--circles', w / 'circles.txt', '-o', out / 'lights.txt'],
        'board print': ['chessboard:9x6:24mm', '-o', out / 'board.pdf'],
        'capture': ['--rig', rig, '-o', out, '--port', w / 'no-port', '--camera', f'folder:{w}'],
        'preview': ['--port', w / 'no-port', '--camera', f'folder:{w}', '-o', out / 'p.jpg'],
        'light': ['off', '--port', w / 'no-port'],
        'devices': ['--port', w / 'no-port'],
        'serve': ['--socket', w / 'daemon.sock', '--port', w / 'no-port', '--camera',
                  f'folder:{w}'],
        'session verify': [session],
        'session overview': [session],
        'bench solve': ['--size', '64x48'],
        'bench accuracy': ['--data', w],
        'bench simulate': ['--size', '64x48'],
        'bench calibrate': ['--runs', '1'],
    }


def help_of(program, words):
    return subprocess.run([program, *words, '--help'], capture_output=True, text=True,
                          check=True).stdout


def commands(program):
    """Yields the words of each command that does something."""
    pending = [[]]
    while pending:
        words = pending.pop(0)
        names = re.findall(r'^  ([a-z]+) ', help_of(program, words).partition('Subcommands:')[2], re.M)
        if words and not names:
            yield words
        pending += [words + [name] for name in names]


def texts(program, words):
    """Options and positionals of a command that take text and not a choice of words."""
    options, positionals = [], []
    section = ''
    for line in help_of(program, words).splitlines():
        if line.endswith(':') and not line.startswith(' '):
            section = line
        found = re.match(r'  (\S+) TEXT(?!:\{)', line)
        if found and section == 'Positionals:':
            positionals.append(found[1])
        elif found and section == 'Options:':
            options.append(found[1].split(',')[-1])
    return options, positionals


def with_option(line, option, path):
    """The command line with the option's value replaced, or added."""
    short = {'--output': '-o'}
    line = list(line)
    for name in (option, short.get(option)):
        if name in line:
            line[line.index(name) + 1] = path
            return line
    return line + [option, path]


# Kinds of special file, the first ones tried without --all.
KINDS = ('pipe', 'device', 'loop', 'terminal', 'dangling', 'folder', 'socket', 'unreadable')
FEW = 3


def make(kind, path):
    """Makes a special file. Returns False where this user cannot."""
    if kind == 'pipe':
        os.mkfifo(path)
    elif kind == 'device' and os.geteuid() == 0:
        # Endless, and of its own: a faulty program could replace the system's.
        os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 5))
    elif kind == 'folder':
        path.mkdir()
    elif kind == 'socket':
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(str(path))
    elif kind == 'unreadable':
        path.touch(0)
        return os.geteuid() != 0  # root reads everything
    else:
        os.symlink({'device': '/dev/zero', 'loop': path.name, 'terminal': '/dev/tty',
                    'dangling': 'nowhere'}[kind], path)
    return True


def serve_ends(words):
    """Starts the daemon, and ends it with SIGTERM if it runs. Returns what was wrong."""
    process = subprocess.Popen([str(word) for word in words], stdin=subprocess.DEVNULL,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(0.3)
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(CLOCK_SECONDS)
        return ''
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return 'SIGTERM does not end the daemon'


def fault_of(outcome, may_be_done):
    """What is wrong with how a run ended, or nothing."""
    if outcome.status is None:
        return 'does not end'
    if outcome.status in runner.REFUSED:
        return '' if outcome.err.strip() else 'is refused without words'
    return '' if outcome.status == runner.DONE and may_be_done else 'is not refused'


class Trial:
    """Runs commands with a special file in one place, each with a new one."""

    def __init__(self, program, work, kinds):
        self.program = program
        self.work = work
        self.kinds = kinds
        self.tally = runner.Tally()
        self.count = 0

    def run(self, name, place, words_of, may_be_done):
        """`place(kind)` makes the file and returns its path; `words_of(path)` is the command."""
        for kind in self.kinds:
            path = place(kind)
            if path is None:
                continue
            before = os.lstat(path)
            words = [self.program, *words_of(path)]
            if words[1] == 'serve':
                outcome, fault = runner.Outcome(0, 0.0, 0.0, 0, ''), serve_ends(words)
            else:
                outcome = runner.run(words, CLOCK_SECONDS)
                fault = fault_of(outcome, may_be_done(kind))
                measures = words[1] == 'bench'  # before it writes
                if not fault and outcome.busy_seconds > SECONDS and not measures:
                    fault = f'takes more than {SECONDS:g} s of processor time'
            after = os.lstat(path) if os.path.lexists(path) else None
            if not fault and (after is None or
                              (before.st_ino, before.st_mode) != (after.st_ino, after.st_mode)):
                fault = 'replaces it'
            self.tally.add(f'{name} <- {kind}', outcome, fault)

    def new_path(self, kind):
        """Makes a special file in a folder of its own."""
        self.count += 1
        folder = self.work / f'special-{self.count}'
        folder.mkdir()
        return folder / kind if make(kind, folder / kind) else None

    def in_session(self, name):
        """Returns a place(): a copy of the session with a special file for one of its files."""
        def place(kind):
            self.count += 1
            session = self.work / f'session-{self.count}'
            shutil.copytree(self.work / 'session', session)
            (session / name).unlink(missing_ok=True)
            return session / name if make(kind, session / name) else None
        return place


def try_options(trial, words, line):
    """A special file for every option and the first positional that takes text."""
    options, positionals = texts(trial.program, words)
    lines = [(option, lambda path, o=option: with_option(line, o, path)) for option in options]
    if positionals:
        lines.append((positionals[0], lambda path: [path, *line[1:]]))
    for option, line_of in lines:
        output = option in ('--output', '--plot', '--markdown', '--pictures')
        trial.run(f'{" ".join(words)} {option}', trial.new_path,
                  lambda path, make_line=line_of: [*words, *make_line(path)],
                  lambda kind, o=option, out=output: o in FREE or kind == 'folder' or
                  (out and kind == 'dangling'))


def try_session(trial, work):
    """A special file for every file of a session that somebody reads."""
    solve = ['solve', '-o', work / 'out']
    uses = {'session.json': (solve, ['session', 'verify'], ['session', 'overview'],
                             ['calibrate', 'lights', '-o', work / 'l.json', '--sheet']),
            'rig.json': (solve,), 'frames/led-1.dng': (solve, ['session', 'verify']),
            'truth/normal.exr': (solve,), 'mask.png': (solve,),
            'journal.jsonl': (['capture', '--port', work / 'no-port', '--resume'],)}
    for name, commands_ in uses.items():
        depth = len(pathlib.PurePath(name).parts)
        for words in commands_:
            trial.run(f'{" ".join(str(word) for word in words[:2])}, {name} of the session',
                      trial.in_session(name),
                      lambda path, w=words, d=depth: [*w, path.parents[d - 1]],
                      # A mask that is no file is none, and a link to nothing is no truth.
                      lambda kind, n=name: n == 'mask.png' or
                      (kind in ('dangling', 'loop') and n.startswith('truth')))


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as temp:
        work = pathlib.Path(temp)
        (work / 'rig.json').write_text(RIG)
        (work / 'scene.json').write_text(SCENE)
        (work / 'circles.txt').write_text('20 20 10\n')
        subprocess.run([program, 'simulate', work / 'scene.json', '-o', work / 'session'],
                       check=True, stdout=subprocess.DEVNULL)
        trial = Trial(program, work, KINDS if '--all' in sys.argv else KINDS[:FEW])
        lines = command_lines(work)
        for words in commands(program):
            if ' '.join(words) not in lines:
                sys.exit(f'{" ".join(words)}: no command line in {__file__}; add one')
            if '--all' in sys.argv or words[0] != 'bench':  # seconds for each
                try_options(trial, words, lines[' '.join(words)])
        try_session(trial, work)
    trial.tally.end()


if __name__ == '__main__':
    main()
