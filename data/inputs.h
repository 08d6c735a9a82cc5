#pragma once

#include <string>

namespace unfurl::data {

// What is hashed as an input is what was parsed: readers tell here what they read, and
// Provenance::AddInput takes it from here. One list for the program; safe from several threads.

// The text of a file was read. Of a pipe (`regular` false) the text is kept, for whoever reads the
// same name again.
void NoteText(const std::string& path, const std::string& text, bool regular);
bool RecallPipe(const std::string& path, std::string* text);

// The program itself has made a new file of that name.
void ForgetInput(const std::string& path);

// A file was opened to be read piece by piece: should it have changed by the time it is hashed,
// that is an Error.
void NoteOpened(const std::string& path);

// A file is an input, read by now or to be read: no result takes its place, by whatever name.
void ProtectInput(const std::string& path);
// From here on, whatever is noted as above is protected, too, until ForgetInput: for a program that
// runs one job, and not for a library, whose user may read a file and write it anew.
void ProtectWhatIsRead();
bool IsInput(const std::string& path);

}  // namespace unfurl::data
