#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "cli/verb.h"

namespace unfurl::cli {

// The kind of value that an option takes, as people read it: "NUMBER above 0" of what CLI11 calls
// "FLOAT:POSITIVE".
std::string ReadableType(std::string type);

// Help with such kinds.
class ReadableFormatter : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override;
};

// `unfurl help [VERB]`: the program's help, or that of a verb. Throws Error for a verb that is
// none.
void PrintHelp(const CLI::App& program, const std::vector<Verb>& verbs, int argc, char** argv);

// Throws Error for a number below 0 where none can be: CLI11 takes -1 for the largest number.
void RefuseNegative(const Verb& verb);

// What is wrong with a command line that could not be parsed, and what was most likely meant.
Error UsageError(const std::vector<Verb>& verbs, int argc, char** argv, const CLI::Error& error);

}  // namespace unfurl::cli
