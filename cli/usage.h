#pragma once

#include <vector>

#include "base/error.h"
#include "cli/verb.h"

namespace CLI {
class Error;
}

namespace unfurl::cli {

// `unfurl help [VERB]`: the program's help, or that of a verb. Throws Error for a verb that is
// none.
void PrintHelp(const CLI::App& program, const std::vector<Verb>& verbs, int argc, char** argv);

// Throws Error for a number below 0 where none can be: CLI11 takes -1 for the largest number.
void RefuseNegative(const Verb& verb);

// What is wrong with a command line that could not be parsed, and what was most likely meant.
Error UsageError(const std::vector<Verb>& verbs, int argc, char** argv, const CLI::Error& error);

}  // namespace unfurl::cli
