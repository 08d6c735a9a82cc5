#pragma once

#include <string>

namespace unfurl {

// The first SIGINT, SIGTERM or SIGHUP asks long work to stop (base/progress.h). Where it has not
// stopped after most of a second, or at a second signal, the program ends from within the handler:
// files that were noted here are removed, so that what is left is what was there before.

// 130 after SIGINT, 143 after SIGTERM and SIGHUP.
int InterruptExitCode();

// A file that must not outlive the program unfinished; gives its place in the list, or -1 where the
// list is full. Any thread may call these.
int NoteTemporary(const std::string& path);
void ForgetTemporary(int place);

// One clear line on standard error, prefixed by the program's name: control characters and bytes
// that are no UTF-8 are shown as \xNN, a line end as \n.
void Complain(const std::string& text);

// `text` as it may be shown on a terminal: the same for control characters other than line ends and
// tabs, and for signs that reorder text.
std::string Printable(const std::string& text);

}  // namespace unfurl
