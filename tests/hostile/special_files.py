#!/usr/bin/env python3
"""Puts pipes, devices, sockets and the like in place of every path of every command of `sateen`.

    special_files.py PROGRAM [--all]

The list comes from the program's own --help: each option and positional that takes text, whether it
is a path or not. Each run must end by itself within 2 s, refused with words and status 2 to 5.
Without --all: a pipe, an endless device and a loop of links alone.
"""

import os
import pathlib
import re
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


def make_special_files(folder, all_kinds):
    files = {}

    def add(name):
        files[name] = folder / name
        return files[name]

    os.mkfifo(add('pipe'))
    if os.geteuid() == 0:  # a device of its own: a faulty program could replace the system's
        os.mknod(add('endless-device'), 0o600 | stat.S_IFCHR, os.makedev(1, 5))
    else:
        os.symlink('/dev/zero', add('endless-device'))
    os.symlink('link-loop', add('link-loop'))
    if not all_kinds:
        return files
    os.symlink('/dev/tty', add('terminal'))
    os.symlink('nowhere', add('dangling-link'))
    add('folder').mkdir()
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(add('socket')))
    if os.geteuid() != 0:
        add('unreadable').touch(0)
    return files


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


def fault_of(outcome, option, kind):
    if outcome.status is None:
        return 'does not end'
    if outcome.status in runner.REFUSED:
        return '' if outcome.err.strip() else 'is refused without words'
    if outcome.status == runner.DONE and kind == 'folder':  # some take one
        return ''
    # A name that is replaced (an output), or that is not a path.
    if outcome.status == runner.DONE and option in FREE | {'--output', '--plot', '--markdown'}:
        return ''
    return 'is not refused'


def try_command(program, words, line, kinds, tally):
    options, positionals = texts(program, words)
    lines = [(option, lambda path, o=option: with_option(line, o, path)) for option in options]
    if positionals:
        lines.append((positionals[0], lambda path: [path, *line[1:]]))
    for option, make in lines:
        for kind, path in kinds.items():
            full = [program, *words, *make(path)]
            name = f'{" ".join(words)} {option} <- {kind}'
            if words == ['serve']:
                tally.add(name, runner.Outcome(0, 0.0, 0.0, 0, ''), serve_ends(full))
                continue
            outcome = runner.run(full, CLOCK_SECONDS)
            fault = fault_of(outcome, option, kind)
            measures = words[0] == 'bench'  # before it writes
            if not fault and outcome.busy_seconds > SECONDS and not measures:
                fault = f'takes more than {SECONDS:g} s of processor time'
            tally.add(name, outcome, fault)


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    tally = runner.Tally()
    with tempfile.TemporaryDirectory() as temp:
        work = pathlib.Path(temp)
        (work / 'rig.json').write_text(RIG)
        (work / 'scene.json').write_text(SCENE)
        (work / 'circles.txt').write_text('1.png 20 20 10\n')
        subprocess.run([program, 'simulate', work / 'scene.json', '-o', work / 'session'],
                       check=True, stdout=subprocess.DEVNULL)
        (work / 'special').mkdir()
        kinds = make_special_files(work / 'special', '--all' in sys.argv)
        lines = command_lines(work)
        for words in commands(program):
            if ' '.join(words) not in lines:
                sys.exit(f'{" ".join(words)}: no command line in {__file__}; add one')
            try_command(program, words, lines[' '.join(words)], kinds, tally)
    tally.end()


if __name__ == '__main__':
    main()
