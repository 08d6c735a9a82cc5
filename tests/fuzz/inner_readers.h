#pragma once

#include <string>

#include "data/raw_layout.h"

namespace unfurl::fuzz {

// Readers of what is no file by itself, of files that need another beside them, and block by block.

// What `unfurl info` shows of any HDF5 file of ours.
void ReadInfo(const std::string& path);
// Block by block, as `reconstruct` and `convert` do.
void ReadTrialBlocks(const std::string& path);
void ReadRunRows(const std::string& path);
// Of two cameras' lines of 20 elements.
void ReadRawLines(data::RawLayout::Format format, const std::string& path);
// A journal of evaluations, as `fit --resume` takes it up; and one evaluation of it.
void ReadJournal(const std::string& path);
void ReadEvaluation(const std::string& path);
// An expression of the time; "KEY=VALUE" of --set, a line each, onto a scene; a length.
void ReadExpression(const std::string& path);
void ReadOverrides(const std::string& path);
void ReadLength(const std::string& path);
// A stream of lines or readings, as it comes from a pipe in small pieces.
void ReadLiveStream(const std::string& path);
// What the program of a command model wrote.
void ReadAnswerOfProgram(const std::string& path);

}  // namespace unfurl::fuzz
