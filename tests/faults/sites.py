"""Where a fault can be planted in a C++ source, and the text that plants it.

A site is an expression rewritten so that its fault is switched on at run time (planted_fault.h): one build holds
all faults. Nothing here parses C++ properly; what does not compile is dropped by the caller.
"""

import bisect
import re
from dataclasses import dataclass, field

# Kinds, and within each the variants with the share of the draws of that kind.
KINDS = {
    "sign": {"sign": 0.9, "abs": 0.1},
    "constant": {"real": 0.65, "integer": 0.35},
    "bound": {"compare": 0.75, "first": 0.1, "max": 0.15},
    "term": {"term": 0.4, "add": 0.3, "factor": 0.1, "call": 0.2},
}
KIND_OF = {variant: kind for kind, variants in KINDS.items() for variant in variants}

TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)
      | (?P<raw>R"(?P<d>[^(\s]*)\(.*?\)(?P=d)") | (?P<str>"(?:\\.|[^"\\\n])*") | (?P<char>'(?:\\.|[^'\\\n])*')
      | (?P<pre>^[ \t]*\#(?:[^\n\\]|\\.|\\\n)*)
      | (?P<num>\.?\d(?:[eE][+-]\d|[\w.'])*) | (?P<id>[A-Za-z_]\w*)
      | (?P<op>->\*|<=>|<<=|\.\.\.|::|->|\+\+|--|&&|\|\||[-+*/%&|^<>=!]=|<<|\S)""",
    re.X | re.S | re.M,
)
KEYWORDS = set("return case throw else do new delete goto sizeof co_return co_yield operator".split())
# An operator of at most the precedence of a comparison ends its operand.
ENDS = set("&& || ? : = , ; { } ! == != <=> += -= *= /= << < > <= >= & | ^ return throw".split())
OPEN, CLOSE = {"(": ")", "[": "]", "{": "}"}, {")", "]", "}"}


@dataclass
class Site:
    file: str
    variant: str
    begin: int  # offsets of the text concerned
    end: int
    edits: list  # (offset, length, text); K stands for the fault's number
    line: int = 0
    last_line: int = 0
    text: str = ""  # the line, stripped
    nth: int = 0  # among the sites of this variant and line text in the file
    number: int = -1
    reason: str = ""
    key: tuple = field(default=())


class Source:
    """Tokens of a file with their brackets."""

    def __init__(self, file, text):
        self.file, self.text = file, text
        self.kind, self.value, self.at = [], [], []
        for m in TOKEN.finditer(text):
            kind = m.lastgroup if m.lastgroup != "d" else "raw"
            if kind in ("comment", "pre"):
                continue
            self.kind.append("str" if kind == "raw" else kind)
            self.value.append(m.group())
            self.at.append(m.start())
        self._brackets()
        self._skips()

    def _brackets(self):
        n = len(self.value)
        self.parent, self.match, self.role = [-1] * n, [-1] * n, [""] * n
        stack = []
        for i, v in enumerate(self.value):
            if v in CLOSE and stack:
                j = stack.pop()
                self.match[i], self.match[j] = j, i
            self.parent[i] = stack[-1] if stack else -1
            if v in OPEN:
                stack.append(i)
                if v == "{":
                    self.role[i] = self._role(i)

    def _role(self, i):
        j = i - 1
        head = []
        while j >= 0 and self.value[j] not in (";", "{", "}") and len(head) < 60:
            head.append(self.value[j])
            j -= 1
        if "namespace" in head:
            return "namespace"
        if "(" not in head and {"class", "struct", "union", "enum"} & set(head):
            return "type"
        return "code"

    def _skips(self):
        """What makes text or an exception is no place for a fault: tests would have to read the words."""
        n = len(self.value)
        self.skip = [False] * n
        strings = {self.parent[i] for i in range(n) if self.kind[i] == "str" and self.parent[i] >= 0
                   and self.value[self.parent[i]] != "{"}
        fmt = {i for i in range(2, n) if self.value[i] == "(" and (
            "fmt" in self.value[max(0, i - 3):i] or self.value[i - 1] in ("reserve", "static_assert"))}
        for i in range(n):
            p = self.parent[i]
            while p >= 0 and not self.skip[i]:
                self.skip[i] = p in strings or p in fmt
                p = self.parent[p]
        start = 0
        for i in range(n + 1):
            if i == n or self.value[i] in (";", "{", "}"):
                words = self.value[start:i]
                if "throw" in words:
                    for j in range(start + words.index("throw"), i):
                        self.skip[j] = True
                elif any(self.kind[j] == "str" and self.value[self.parent[j]] == "{" for j in range(start, i)):
                    for j in range(start, i):
                        self.skip[j] = True
                start = i + 1

    def in_code(self, i):
        p = self.parent[i]
        while p >= 0:
            if self.role[p] == "code":
                return True
            p = self.parent[p]
        return False

    def statement_end(self, i):
        """The `;` that ends the statement of token i, at its own depth, or -1."""
        p = self.parent[i]
        while i < len(self.value):
            if self.parent[i] == p and self.value[i] == ";":
                return i
            if self.value[i] in OPEN and self.match[i] > i:
                i = self.match[i]
            elif self.value[i] in CLOSE:
                return -1
            i += 1
        return -1

    def operand(self, i, step):
        """The last token of the operand of a comparison to the right (step 1) or left (-1) of token i."""
        j = last = i
        while True:
            j += step
            if j < 0 or j >= len(self.value) or self.value[j] in ENDS:
                return last
            if self.value[j] in (OPEN if step > 0 else CLOSE):
                if self.match[j] < 0 or self.value[j] in "{}":
                    return last
                j = self.match[j]
            elif self.value[j] in (CLOSE if step > 0 else OPEN):
                return last
            last = j

    def spaced(self, i):
        a = self.at[i]
        b = a + len(self.value[i])
        return self.text[a - 1].isspace() and self.text[b:b + 1].isspace()

    def is_value(self, i):
        """Whether token i can end an operand, so that a following + or - has two."""
        return (self.kind[i] in ("id", "num") and self.value[i] not in KEYWORDS) or self.value[i] in (")", "]")


def _end(s, i):
    return s.at[i] + len(s.value[i])


def _number(v):
    try:
        return float(v.rstrip("fFlLuUzZ").replace("'", "")) if not v.lower().startswith("0x") else 0.0
    except ValueError:
        return 0.0


def _constant(s, i):
    v = s.value[i]
    x = _number(v)
    if x == 0.0:
        return None
    if re.fullmatch(r"[\d']+[uUzZlL]*", v):
        return "integer", [(s.at[i], len(v), f"({v} + planted::On(K))")]
    # Of a tolerance the order of magnitude matters, of a coefficient the value.
    scale = 1000.0 if "e-" in v.lower() else 1.5
    return "real", [(s.at[i], len(v), f"planted::Scale(K, {scale}, {v})")]


def _named_constant(s, i):
    """constexpr double kName = ...; becomes a constant computed at start."""
    end = s.statement_end(i)
    if end < 0 or "double" not in s.value[i:i + 4] or "=" not in s.value[i:i + 5]:
        return None
    first = s.value.index("=", i) + 1
    if s.value[first] == "{" or "(" in s.value[i:first]:
        return None
    body = s.text[s.at[first]:s.at[end]]
    scale = 1000.0 if "e-" in body.lower() else 1.5
    edits = [(s.at[i], len("constexpr"), "const"), (s.at[first], 0, f"planted::Scale(K, {scale}, "),
             (s.at[end], 0, ")")]
    return Site(s.file, "real", s.at[i], s.at[end], edits)


def _after_operator(s, i):
    """Faults that begin at token i, an operator inside code."""
    v, found = s.value[i], []
    if v in ("+", "-") and s.spaced(i) and s.is_value(i - 1):
        for variant, name in (("sign", "Sign"), ("term", "Keep")):
            found.append((variant, [(_end(s, i), 0, f" planted::{name}(K) *")]))
    elif v == "-" and not s.is_value(i - 1) and s.value[i - 1] != "operator":
        found.append(("sign", [(_end(s, i), 0, "planted::Sign(K) * ")]))
    elif v in ("+=", "-=", "*=", "/="):
        end = s.statement_end(i)
        if end > 0:
            call = "planted::Keep(K) * (" if v in ("+=", "-=") else "planted::Factor(K, "
            found.append(("add" if v in ("+=", "-=") else "factor", [(s.at[i + 1], 0, call), (s.at[end], 0, ")")]))
    elif v in ("<", ">", "<=", ">=") and s.spaced(i):
        left, right = s.operand(i, -1), s.operand(i, 1)
        if left < i < right:
            op = f"planted::Compare<'{v[0]}', {'true' if len(v) > 1 else 'false'}>(K, "
            found.append(("compare", [(s.at[left], 0, op), (s.at[i] - 1, len(v) + 1, ","), (_end(s, right), 0, ")")]))
    return found


def _after_name(s, i):
    v, found = s.value[i], []
    if s.kind[i] == "num":
        constant = _constant(s, i)
        if constant:
            found.append(constant)
        elif v == "0" and s.value[i - 1] == "=" and s.value[i + 1] == ";" and "for" in s.value[max(0, i - 8):i]:
            found.append(("first", [(s.at[i], 1, "0 + planted::On(K)")]))
    elif v == "std" and s.value[i + 1] == "::" and s.value[i + 2] in ("max", "min", "abs") and s.value[i + 3] == "(":
        call = f"planted::{s.value[i + 2].capitalize()}(K, "
        found.append(("abs" if s.value[i + 2] == "abs" else "max", [(s.at[i], _end(s, i + 3) - s.at[i], call)]))
    elif s.kind[i] == "id" and s.value[i - 1] in (";", "{", "}") and v not in KEYWORDS:
        end = s.statement_end(i)
        p = s.parent[i]
        if p >= 0 and s.role[p] == "code" and 0 < end and s.value[end - 1] == ")" and _is_call(s, i, end):
            found.append(("call", [(s.at[i], 0, "if (!planted::On(K)) ")]))
    return found


def _is_call(s, i, end):
    """name(::name|.name|->name)* ( ... ) ; and nothing else."""
    while i < end:
        if s.kind[i] == "id" and s.value[i + 1] in ("::", ".", "->"):
            i += 2
        elif s.kind[i] == "id" and s.value[i + 1] == "(":
            close = s.match[i + 1]
            if close == end - 1:
                return True
            if s.value[close + 1] not in (".", "->"):
                return False
            i = close + 2
        else:
            return False
    return False


def sites_of(file, text):
    """All sites of a file, in order, with their keys."""
    s = Source(file, text)
    found = []
    for i in range(1, len(s.value) - 4):
        if s.value[i] == "constexpr":
            site = _named_constant(s, i)
            if site:
                found.append(site)
        if s.skip[i] or not s.in_code(i):
            continue
        pairs = _after_operator(s, i) if s.kind[i] == "op" else _after_name(s, i)
        for variant, edits in pairs:
            begin, end = min(e[0] for e in edits), max(e[0] + e[1] for e in edits)
            found.append(Site(file, variant, begin, max(end, _end(s, i)), edits))
    lines = text.splitlines()
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line) + 1)
    seen = {}
    for site in found:
        site.line = bisect.bisect_right(starts, site.begin)
        site.last_line = bisect.bisect_right(starts, site.end)
        site.text = lines[site.line - 1].strip()
        site.nth = seen.get((site.variant, site.text), 0)
        seen[(site.variant, site.text)] = site.nth + 1
        site.key = (file, site.variant, site.text, site.nth)
    return found


def planted_text(text, file, sites):
    """The source with its sites rewritten; its lines keep their numbers."""
    edits = sorted(((at, length, new.replace("(K", f"({site.number}")) for site in sites
                    for at, length, new in site.edits), key=lambda e: e[0])
    out, last = [], 0
    for at, length, new in edits:
        out += [text[last:at], new]
        last = at + length
    out.append(text[last:])
    return f'#include "tests/faults/planted_fault.h"\n#line 1 "{file}"\n' + "".join(out)
