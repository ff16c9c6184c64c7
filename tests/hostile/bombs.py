#!/usr/bin/env python3
"""Gives `sateen solve` small files that unfold into large ones, or into endless work.

    bombs.py PROGRAM [NAME] [--verbose]

Each must be refused (exit status 2 to 5, with words) within 1 s and 300 MB; the address space has
2 GB. The processor's seconds count, so that a busy machine fails no one. Frames that are right and
find no room must be called out of memory (status 1).
"""

import os
import pathlib
import struct
import sys
import tempfile
import zlib

import runner

MAX_SECONDS = 1.0
MAX_MEGABYTES = 300
CLOCK_SECONDS = 20.0  # the end of a run that waits


def zeros(count):
    """Returns at least `count` zeros, deflated: one piece, many times."""
    pack = zlib.compressobj(9)
    head = pack.compress(b'') + pack.flush(zlib.Z_FULL_FLUSH)
    piece = pack.compress(bytes(1 << 20)) + pack.flush(zlib.Z_FULL_FLUSH)
    return head + piece * (count // (1 << 20) + 1) + pack.flush()


def chunk(kind, data):
    return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))


def png(width, height, depth, colour, data, more=b''):
    head = struct.pack('>IIBBBBB', width, height, depth, colour, 0, 0, 0)
    return (b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', head) + more + chunk(b'IDAT', data) +
            chunk(b'IEND', b''))


def tga(width, height, kind, bits, data):
    return struct.pack('<BBBHHBHHHHBB', 0, 0, kind, 0, 0, 0, 0, 0, width, height, bits, 0) + data


def tiff(entries, data=b''):
    """A TIFF of one directory; the data begin at byte 14 + 12 entries."""
    head = b'II*\0' + struct.pack('<IH', 8, len(entries))
    return head + b''.join(struct.pack('<HHII', *e) for e in entries) + bytes(4) + data


def grey_tiff(width, height, compression, data, more=()):
    entries = 9 + len(more)
    return tiff([(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, compression),
                 (262, 3, 1, 1), (273, 4, 1, 14 + 12 * entries), (277, 3, 1, 1),
                 (278, 4, 1, height), (279, 4, 1, len(data)), *more], data)


def jpeg(width, height, progressive):
    return (b'\xff\xd8\xff\xe0\0\x10JFIF\0\1\1\0\0\1\0\1\0\0\xff\xdb\0C\0' + b'\1' * 64 +
            (b'\xff\xc2' if progressive else b'\xff\xc0') +
            struct.pack('>HBHHB', 17, 8, height, width, 3) + b'\1\x22\0\2\x11\0\3\x11\0' +
            b'\xff\xc4\0\x14\0\1' + bytes(16) + b'\xff\xc4\0\x14\x10\1' + bytes(16) + b'\xff\xda\0\x0c\3\1\0\2\0\3\0\0\x3f\0' +
            bytes(100000) + b'\xff\xd9')


def exr(width, height, compression=2, more=b'', version=2, data=bytes(2000)):
    def attribute(name, kind, value):
        return name + b'\0' + kind + b'\0' + struct.pack('<I', len(value)) + value

    box = struct.pack('<iiii', 0, 0, width - 1, height - 1)
    return (b'\x76\x2f\x31\x01' + struct.pack('<I', version) +
            attribute(b'channels', b'chlist', b'Y\0' + struct.pack('<IIII', 2, 0, 1, 1) + b'\0') +
            attribute(b'compression', b'compression', bytes([compression])) +
            attribute(b'dataWindow', b'box2i', box) + attribute(b'displayWindow', b'box2i', box) +
            attribute(b'lineOrder', b'lineOrder', b'\0') +
            attribute(b'pixelAspectRatio', b'float', struct.pack('<f', 1)) +
            attribute(b'screenWindowCenter', b'v2f', bytes(8)) +
            attribute(b'screenWindowWidth', b'float', struct.pack('<f', 1)) + more + b'\0' + data)


def exr_of_zeros(width, height):
    """An uncompressed EXR that is right: an offset for each row, then the rows."""
    head = exr(width, height, compression=0, data=b'')
    row_bytes = 8 + 4 * width
    start = len(head) + 8 * height
    offsets = b''.join(struct.pack('<Q', start + y * row_bytes) for y in range(height))
    rows = b''.join(struct.pack('<iI', y, 4 * width) + bytes(4 * width) for y in range(height))
    return head + offsets + rows


def dng(width, height, compression, data):
    """A DNG of one CFA picture."""
    entries = [(254, 4, 1, 0), (256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 16),
               (259, 3, 1, compression), (262, 3, 1, 32803), (273, 4, 1, 14 + 12 * 13),
               (277, 3, 1, 1), (278, 4, 1, height), (279, 4, 1, len(data)),
               (33421, 3, 2, 0x00020002), (33422, 1, 4, 0x02010100), (50706, 1, 4, 0x00000401)]
    return tiff(entries, data)


def mat(height, width, data_bytes):
    """A MATLAB file whose header says more than its packed values hold."""
    def element(kind, data):
        return struct.pack('<II', kind, len(data)) + data + bytes(-len(data) % 8)

    inside = (element(6, struct.pack('<II', 6, 0)) +
              element(5, struct.pack('<iii', height, width, 3)) + element(1, b'Normal_gt'))
    pack = zlib.compressobj(9)
    total = height * width * 24
    packed = [pack.compress(struct.pack('<II', 14, (len(inside) + 8 + total) & 0xffffffff) +
                            inside + struct.pack('<II', 9, total & 0xffffffff))]
    packed += [pack.compress(bytes(1 << 20)) for _ in range(data_bytes >> 20)] + [pack.flush()]
    body = b''.join(packed)
    return (b'MATLAB 5.0 MAT-file'.ljust(124) + struct.pack('<H', 0x0100) + b'IM' +
            struct.pack('<II', 15, len(body)) + body)


def pictures():
    """Bombs in place of photographs: file name and bytes."""
    small = zlib.compress(bytes(65 * 48))
    text = b'k\0\0' + zeros(300 << 20)
    yield 'rgb-400-megapixels.png', png(20000, 20000, 8, 2, zeros(60001 * 20000))
    yield 'grey-900-megapixels.png', png(30000, 30000, 16, 0, zeros(400 << 20))
    yield 'largest.png', png(2**31 - 1, 2**31 - 1, 16, 6, small)
    yield 'one-row.png', png(2**31 - 1, 1, 8, 0, small)
    yield 'one-column.png', png(1, 2**31 - 1, 8, 0, small)
    yield 'interlaced.png', png(20000, 20000, 8, 2, small)
    yield 'no-size.png', png(0, 0, 8, 2, small)
    yield 'text.png', png(64, 48, 8, 0, b'', chunk(b'zTXt', text))
    yield 'profile.png', png(64, 48, 8, 0, b'', chunk(b'iCCP', text))
    yield 'empty-chunks.png', b'\x89PNG\r\n\x1a\n' + chunk(b'tEXt', b'') * 1_500_000
    yield 'runs.tga', tga(65535, 65535, 11, 8, b'\xff\0' * 200_000)
    yield 'raw.tga', tga(65535, 65535, 2, 24, bytes(1000))
    yield 'palette.tga', tga(30000, 30000, 9, 8, b'\xff\0' * 200_000)
    yield 'deflate.tif', grey_tiff(30000, 30000, 8, zeros(900 << 20))
    yield 'packbits.tif', grey_tiff(40000, 40000, 32773, b'\x81\0' * 100_000)
    yield 'lzw.tif', grey_tiff(40000, 40000, 5, b'\x80' * 200_000)
    yield 'fax.tif', grey_tiff(60000, 60000, 4, bytes(100_000))
    yield 'tiles.tif', tiff([(256, 4, 1, 2**31 - 1), (257, 4, 1, 2**31 - 1), (258, 3, 1, 8),
                             (259, 3, 1, 1), (262, 3, 1, 1), (277, 3, 1, 1), (322, 4, 1, 16),
                             (323, 4, 1, 16), (324, 4, 2**30, 200), (325, 4, 2**30, 200)])
    yield 'strips.tif', tiff([(256, 4, 1, 1), (257, 4, 1, 2**31 - 1), (258, 3, 1, 8),
                              (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 2**28, 200),
                              (277, 3, 1, 1), (278, 4, 1, 1), (279, 4, 2**28, 200)])
    yield 'entries.tif', (b'II*\0' + struct.pack('<IH', 8, 65535) +
                          struct.pack('<HHII', 273, 4, 60000, 8) * 65535 + bytes(300_000))
    yield 'directories.tif', b'II*\0' + struct.pack('<I', 8) + b''.join(
        struct.pack('<HHHIII', 1, 256, 4, 1, 1, 26 + 18 * i) for i in range(100_000))
    yield 'bigtiff.tif', b'II+\0' + struct.pack('<HHQQ', 8, 0, 16, 2**60)
    yield 'baseline.jpg', jpeg(65500, 65500, False)
    yield 'progressive.jpg', jpeg(20000, 20000, True)
    yield 'tall.exr', exr(1, 2**30)
    yield 'tall-packed.exr', exr(1, 2**27, compression=3)
    yield 'wide.exr', exr(2**30, 1)
    yield 'square.exr', exr(30000, 30000)
    yield 'largest.exr', exr(2**31 - 1, 2**31 - 1, compression=4)
    yield 'tiles.exr', exr(2**20, 2**20, version=0x202,
                           more=b'tiles\0tiledesc\0' + struct.pack('<IIIB', 9, 1, 1, 0))
    yield 'mip-tiles.exr', exr(2**15, 2**15, version=0x202,
                               more=b'tiles\0tiledesc\0' + struct.pack('<IIIB', 9, 1, 1, 1))
    yield 'attribute.exr', exr(64, 48, more=b'x\0string\0' + struct.pack('<I', 2**31 - 16))
    yield 'dwa.exr', exr(20000, 20000, compression=8)
    yield 'lossless.dng', dng(60000, 60000, 7, b'\xff\xd8' + bytes(200_000))
    yield 'uncompressed.dng', dng(60000, 60000, 1, bytes(200_000))
    yield 'deflate.dng', dng(30000, 30000, 8, zeros(600 << 20))
    yield 'entries.dng', (b'II*\0' + struct.pack('<IH', 8, 20000) +
                          struct.pack('<HHII', 330, 4, 60000, 8) * 20000 + bytes(40_000))


def texts():
    """Bombs in place of records and tables: how they are given, name and bytes."""
    yield 'rig', 'deep.json', b'[' * 5_000_000
    yield 'rig', 'wide.json', b'[' + b'{},' * 2_790_000 + b'{}]'
    yield 'rig', 'keys.json', b'{' + b','.join(b'"%d":0' % i for i in range(700_000)) + b'}'
    yield 'rig', 'long.json', b'{"schema":"' + b'a' * 50_000_000 + b'"}'
    yield 'capture', 'many.lp', b'170000\n' + b'a.png 0 0 1\n' * 170_000
    yield 'rig', 'numbers.json', b'[' + b'0,' * 4_190_000 + b'0]'
    yield 'capture', 'lines.lp', b'1\n' * 1_000_000
    yield 'capture', 'says-many.lp', b'1000000000\na.png 0 0 1\n'
    yield 'mask', 'mask.png', png(20000, 20000, 8, 0, zeros(20001 * 20000))
    yield 'truth', 'Normal_gt.mat', mat(20000, 20000, 400 << 20)
    yield 'truth', 'Normal_gt.mat (small file)', mat(60000, 60000, 1 << 20)
    yield 'truth', 'normal_gt.exr', exr(30000, 30000, compression=3)


def sparse(path, bytes_):
    with open(path, 'wb') as file:
        file.truncate(bytes_)


def write_folder(folder):
    """A folder of five small frames with their lights, which solves."""
    folder.mkdir(parents=True)
    picture = png(64, 48, 8, 0, zlib.compress(b''.join(
        b'\0' + bytes(100 + (x + y) % 50 for x in range(64)) for y in range(48))))
    for i in range(5):
        (folder / f'{i}.png').write_bytes(picture)
    (folder / 'lights.txt').write_text('0 0 1\n0.6 0 0.8\n-0.6 0 0.8\n0 0.6 0.8\n0 -0.6 0.8\n')


def command(program, folder, out, use, path):
    if use == 'rig':
        return [program, 'solve', folder, '--rig', path, '-o', out]
    if use == 'mask':
        return [program, 'solve', folder, '--mask', path, '-o', out]
    if use == 'capture':
        return [program, 'solve', path, '-o', out]
    return [program, 'solve', folder, '-o', out]  # what lies in the folder


def diligent(folder, name, data):
    folder.mkdir()
    for i in range(5):
        os.link(folder.parent / 'small' / f'{i}.png', folder / f'00{i}.png')
    (folder / 'filenames.txt').write_text(''.join(f'00{i}.png\n' for i in range(5)))
    (folder / 'light_directions.txt').write_text((folder.parent / 'small/lights.txt').read_text())
    (folder / 'light_intensities.txt').write_text('1 1 1\n' * 5)
    (folder / name).write_bytes(data)


def cases(work):
    """Name, how it is given and path of each bomb, made one at a time."""
    for name, data in pictures():
        folder = work / 'pictures' / name
        write_folder(folder)
        ending = pathlib.Path(name).suffix
        for i in range(5):
            (folder / f'{i}.png').unlink()
            (folder / f'{i}{ending}').write_bytes(data)
        yield name, 'folder', folder
    for use, name, data in texts():
        file_name = name.split(' ')[0]
        if use == 'truth':
            folder = work / ('truth-' + name.replace(' ', '-'))
            diligent(folder, file_name, data)
            yield name, 'folder', folder
        else:
            (work / file_name).write_bytes(data)
            yield name, use, work / file_name
    for use, name in (('rig', 'sparse.json'), ('capture', 'sparse.lp'), ('mask', 'sparse.tif')):
        sparse(work / name, 2**40)
        yield name, use, work / name


def try_without_room(program, work, tally):
    """Frames of 20 megapixels, which are right, in 500 MB of address space."""
    frames = {'.png': png(5000, 4000, 8, 0, zlib.compress(bytes(5001 * 4000))),
              '.exr': exr_of_zeros(5000, 4000)}
    for ending, frame in frames.items():
        folder = work / f'large{ending}'
        write_folder(folder)
        for i in range(5):
            (folder / f'{i}.png').unlink()
            (folder / f'{i}{ending}').write_bytes(frame)
        outcome = runner.run([program, 'solve', folder, '-o', work / 'out', '--threads', '1'],
                             CLOCK_SECONDS, 500 << 20)
        said = (outcome.status == 1 and 'out of memory' in outcome.err and
                'damaged' not in outcome.err)
        tally.add(f'no room for large {ending}', outcome,
                  '' if said else 'is not called out of memory')


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    words = [word for word in sys.argv[2:] if word != "--verbose"]
    only = words[0] if words else ""
    verbose = "--verbose" in sys.argv
    tally = runner.Tally()
    with tempfile.TemporaryDirectory() as temp:
        work = pathlib.Path(temp)
        write_folder(work / 'small')
        plain = runner.run([program, 'solve', work / 'small', '-o', work / 'plain'], 20.0)
        tally.add('a folder that is right', plain, plain.status != runner.DONE and 'does not solve')
        for name, use, path in cases(work):
            if only not in name:
                continue
            folder = path if use == 'folder' else work / 'small'
            outcome = runner.run(command(program, folder, work / 'out', use, path), CLOCK_SECONDS)
            fault = ''
            if outcome.status not in runner.REFUSED:
                fault = 'was not refused'
            elif outcome.busy_seconds > MAX_SECONDS:
                fault = f'took more than {MAX_SECONDS:g} s of processor time'
            elif outcome.megabytes > MAX_MEGABYTES:
                fault = f'took more than {MAX_MEGABYTES} MB'
            elif 'error: ' not in outcome.err:
                fault = 'was refused without words'
            tally.add(name, outcome, fault)
            if verbose:
                print(f"{name}: {outcome.err.strip()}")
        try_without_room(program, work, tally)
    tally.end()


if __name__ == '__main__':
    main()
