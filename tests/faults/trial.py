"""The planted tree: copying, building, and running tests in it one fault at a time."""

import hashlib
import json
import os
import re
import resource
import subprocess
import time
from pathlib import Path

from sites import planted_text

# Rooms of tests that link nothing of the rooms under trial.
ELSEWHERE = {"base", "data", "report", "structure", "faults"}


def copy_tree(root, tree, by_file):
    """Copies what is under version control, with the sites planted; writes only what changed."""
    listed = subprocess.run(["git", "-C", root, "ls-files", "-co", "--exclude-standard", "-z"], capture_output=True)
    if listed.returncode:
        raise SystemExit(f"planted-faults: {root} is no git checkout; what is copied is what git lists")
    names = listed.stdout.decode().split("\0")
    wanted = set()
    for name in filter(None, names):
        source, target = Path(root, name), Path(tree, name)
        if not source.is_file():
            continue
        wanted.add(name)
        content = source.read_bytes()
        if name in by_file:
            content = planted_text(content.decode(), name, by_file[name]).encode()
        if target.is_file() and target.read_bytes() == content:
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
        target.chmod(source.stat().st_mode)
    for old in [p for p in Path(tree).rglob("*") if p.is_file()]:
        name = str(old.relative_to(tree))
        if not name.startswith("build/") and name not in wanted:
            old.unlink()


def quick_tests(tree):
    """Test programs of the default label: [(folder, name)]."""
    found = []
    for path in sorted(Path(tree, "tests").glob("*/CMakeLists.txt")):
        if path.parent.name in ELSEWHERE:
            continue
        for name, body in re.findall(r"unfurl_test\((\w+)([^)]*)\)", path.read_text()):
            if not re.search(r"LABELS\s+\"?slow", body):
                found.append((path.parent.name, name))
    return found


class Trial:
    def __init__(self, tree, jobs):
        self.tree, self.build, self.jobs = Path(tree), Path(tree, "build", "dev"), jobs
        self.known = Path(tree).parent / "baseline.json"

    def configure(self):
        command = ["cmake", "-S", self.tree, "--preset", "dev"]
        if subprocess.run(["which", "ccache"], capture_output=True).returncode == 0:
            command += [f"-DCMAKE_{language}_COMPILER_LAUNCHER=ccache" for language in ("C", "CXX")]
        if subprocess.run(["which", "ld.lld"], capture_output=True).returncode == 0:
            command.append("-DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=lld")
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"planted-faults: cmake failed\n{done.stderr[-3000:]}")

    def compile(self, targets, go_on):
        """Builds; returns what the compiler wrote, empty if all is well."""
        command = ["nice", "cmake", "--build", self.build, f"-j{self.jobs}", "--target", *targets, "--"]
        done = subprocess.run(command + (["-k", "0"] if go_on else []), stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
        return done.stdout if done.returncode else ""

    def program(self, folder, name):
        return self.build / "tests" / folder / name

    def run(self, folder, name, tests, fault=None, reached=None, cpu=None):
        """Runs some tests of a program: (exit code, output, CPU seconds)."""
        env = dict(os.environ)
        for key in ("UNFURL_FAULT", "UNFURL_FAULT_REACHED"):
            env.pop(key, None)
        if fault is not None:
            env["UNFURL_FAULT"] = str(fault)
        if reached:
            env["UNFURL_FAULT_REACHED"] = str(reached)

        def limits():
            os.nice(10)
            os.setpgid(0, 0)
            if cpu:
                resource.setrlimit(resource.RLIMIT_CPU, (int(cpu) + 1, int(cpu) + 2))
            resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))

        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [self.program(folder, name), "--gtest_fail_fast", "--gtest_color=no",
                   "--gtest_filter=" + ":".join(tests)]
        process = subprocess.Popen(command, cwd=self.program(folder, name).parent, env=env, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, preexec_fn=limits)
        try:
            out, _ = process.communicate(timeout=20 * cpu + 60 if cpu else None)
            code = process.returncode
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            out, _ = process.communicate()
            code = -24
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return code, out.decode(errors="replace"), after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def list_tests(self, folder, name):
        out = subprocess.run([self.program(folder, name), "--gtest_list_tests"], capture_output=True, text=True,
                             check=True, cwd=self.program(folder, name).parent).stdout
        tests, suite = [], ""
        for line in out.splitlines():
            word = line.split("#")[0].strip()
            if not word or word.startswith("Running main"):
                continue
            if not line.startswith(" "):
                suite = word
            elif "DISABLED_" not in suite + word:
                tests.append(suite + word)
        return tests

    def baseline(self, programs, keep, say):
        """Every test alone with no fault on: {(folder, name, test): (seconds, sites reached)}, and those that fail."""
        known = json.loads(self.known.read_text()) if self.known.is_file() else {}
        result, broken = {}, []
        for folder, name in programs:
            stamp = hashlib.sha256(self.program(folder, name).read_bytes())
            if folder == "cli":
                stamp.update((self.build / "cli" / "unfurl").read_bytes())
            stamp = stamp.hexdigest()
            for test in self.list_tests(folder, name):
                key = f"{folder}/{name}/{test}"
                entry = known.get(key)
                if not entry or (entry["stamp"] != stamp and not keep):
                    reached = self.known.parent / "reached"
                    reached.unlink(missing_ok=True)
                    code, out, seconds = self.run(folder, name, [test], reached=reached)
                    sites = sorted({int(k) for k in reached.read_text().split()}) if reached.is_file() else []
                    entry = known[key] = {"stamp": stamp, "seconds": round(seconds, 3), "sites": sites, "code": code}
                    if code:
                        say(f"  {key} fails without a fault:\n{out[-1500:]}")
                    if seconds > 1 or len(known) % 50 == 0:
                        self.known.write_text(json.dumps(known))
                if entry["code"]:
                    broken.append(key)
                    continue
                result[(folder, name, test)] = (entry["seconds"], set(entry["sites"]))
        self.known.write_text(json.dumps(known))
        return result, broken

    def catch(self, site, baseline, limit):
        """The first test that fails with this fault on, or ''; how many tests reach it; whether some were not run.

        A room's own tests go first: what they catch is found nearest to where it is."""
        room = site.file.split("/")[0]
        reaching = [(seconds, test) for test, (seconds, sites) in baseline.items() if site.number in sites]
        own = sorted(t for t in reaching if t[1][0] == room)
        other = sorted(t for t in reaching if t[1][0] != room)
        # Cheap ones of a program share a process; what takes a second has its own.
        batches = []
        for group in (own, other):
            cheap = {}
            for seconds, test in group:
                if seconds < 1.0:
                    cheap.setdefault(test[:2], []).append((seconds, test[2]))
            for program, tests in sorted(cheap.items()):
                batches += self._batches(program, tests)
        batches += sorted((seconds, test[:2], [test[2]]) for seconds, test in reaching if seconds >= 1.0)
        spent = 0.0
        for seconds, program, tests in batches:
            if limit and spent + seconds > limit:
                return "", len(reaching), "not all run"
            code, out, used = self.run(*program, tests, fault=site.number, cpu=4 * seconds + 3)
            spent += used
            if code:
                return self._first_failure(program, out, code), len(reaching), ""
        return "", len(reaching), ""

    @staticmethod
    def _batches(program, tests):
        """Cheap tests together, a second's worth to a process: an endless loop costs no more than that."""
        batches = []
        for seconds, test in tests:
            if batches and batches[-1][0] + seconds < 1.0:
                batches[-1] = (batches[-1][0] + seconds, program, batches[-1][2] + [test])
            else:
                batches.append((seconds, program, [test]))
        return batches

    @staticmethod
    def _first_failure(program, out, code):
        failed = re.findall(r"^\[  FAILED  \] ([^\s,]+)", out, re.M)
        if failed:
            return f"{program[0]}: {failed[0]}"
        started = re.findall(r"^\[ RUN      \] (\S+)", out, re.M)
        how = "runs too long" if code in (-24, -9) else "crashes"
        return f"{program[0]}: {started[-1] if started else '?'} ({how})"


def failed_lines(output):
    """{(file, line)} named by the compiler, and the files whose compilation failed."""
    lines = {(m[0], int(m[1])) for m in re.findall(r"((?:sim|measure|calib|correlate)/[\w/]+\.cc):(\d+)", output)}
    files = set(re.findall(r"FAILED: .*?unfurl_\w+\.dir/\S+", output))
    return lines, files


def clock():
    return time.strftime("%H:%M:%S")
