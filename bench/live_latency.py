#!/usr/bin/env python3
"""How long a line takes to become points: a recorded trial sent at its own pace, stamps at both ends.

    bench/live_latency.py build/release/cli/unfurl trial.h5 rig.h5 [SECONDS] [MORE OPTIONS OF reconstruct ..]

Sends the trial's lines, forwards and backwards in turn, to `unfurl reconstruct --live` by a pipe, each when it is due,
and reads what comes back. For each sample: from the moment at which its line was handed to the pipe until its text had
been read, so with what the pipes, this program and the wait for later lines add.
"""

import array
import json
import os
import resource
import struct
import subprocess
import sys
import threading
import time


def lines_of(program, trial):
    """The header's bytes, and (time, the bytes behind the stamp) of each line."""
    stream = subprocess.run([program, "stream", trial], check=True, capture_output=True).stdout
    at = stream.index(b"\n") + 1
    header = stream[:at]
    about = json.loads(header)
    formats = about["format"] if isinstance(about["format"], list) else [about["format"]] * len(about["cameras"])
    counts = sum(sum(f[k] for k in ("dummy", "dark", "active", "dark_after", "parity")) for f in formats)
    lines = []
    while stream[at:at + 4] == b"LINE":
        _, slot, _, t = struct.unpack_from("<4sIQd", stream, at)
        lines.append((t, slot, stream[at + 24:at + 24 + 2 * counts]))
        at += 24 + 2 * counts
    return header, lines


def resident(process):
    with open(f"/proc/{process}/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))


def main():
    program, trial, rig = sys.argv[1:4]
    seconds = float(sys.argv[4]) if len(sys.argv) > 4 else 60.0
    header, lines = lines_of(program, trial)
    step = (lines[-1][0] - lines[0][0]) / (len(lines) - 1)
    job = subprocess.Popen([program, "reconstruct", "--live", "--rig", rig, *sys.argv[5:]],
                           stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    sent = {}      # line's time to the clock at which it was sent
    delays, end, last = array.array("d"), {}, [0.0]
    memory = []    # of the job, every ten seconds [kB]

    def read():
        for text in job.stdout:
            now = time.monotonic()
            line = json.loads(text)
            if line["type"] == "sample":
                delays.append(now - sent[line["t"]])
                last[0] = line["t"]
            elif line["type"] == "end":
                end.update(line)

    reader = threading.Thread(target=read)
    reader.start()
    pipe = job.stdin.fileno()

    def send(data):
        while data:
            data = data[os.write(pipe, data):]

    send(header)
    start, n, late, passed = time.monotonic(), 0, 0.0, 0
    while n * step < seconds:
        turn, k = divmod(n, len(lines))
        _, slot, counts = lines[k if turn % 2 == 0 else len(lines) - 1 - k]
        t = n * step
        due = start + t
        wait = due - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        late = max(late, -wait)
        sent[t] = time.monotonic()
        send(struct.pack("<4sIQd", b"LINE", slot, n, t) + counts)
        n += 1
        if t >= 10.0 * (len(memory) + 1):
            memory.append(resident(job.pid))
        # Lines whose samples are all out are forgotten, but for what may still wait.
        while passed * step < last[0] - 1.0:
            sent.pop(passed * step, None)
            passed += 1
    send(struct.pack("<4sIQd", b"END.", 0, n, 0.0))
    job.stdin.close()
    reader.join()
    job.wait()
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    delays = sorted(delays)
    quantile = lambda q: 1e3 * delays[min(len(delays) - 1, int(q * len(delays)))]
    print(f"{n} lines in {time.monotonic() - start:.1f} s, {len(delays)} samples, exit code {job.returncode}")
    print(f"line sent to point read: median {quantile(0.5):.2f} ms, 99% {quantile(0.99):.2f} ms, "
          f"99.9% {quantile(0.999):.2f} ms, most {quantile(1.0):.2f} ms")
    within = sum(d <= 5e-3 for d in delays) / len(delays)
    print(f"within 5 ms: {100 * within:.3f}%; this program was late by {1e3 * late:.1f} ms at most")
    if memory:
        print(f"memory after 10 s {memory[0] / 1e3:.1f} MB, at a half {memory[len(memory) // 2] / 1e3:.1f}, "
              f"at the end {memory[-1] / 1e3:.1f}")
    print(f"processor time of the program {used.ru_utime + used.ru_stime:.1f} s, with what read the trial")
    print(f"the program's own: {end.get('latency_ms')} ms; waited for later lines: {end.get('waited_s')} s")


if __name__ == "__main__":
    main()
